"""Delays of the closed loop in readings and command: from none on, through those shorter than a step."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flexarm_env import SensorParameters
from tests.support.loops import END_EFFECTOR, PER_JOINT, SHARED, loop_of, simulated
from tests.support.oracle import PAPER, Problem

pytestmark = pytest.mark.compiled


def test_no_delay_is_the_collocated_loop_bit_for_bit() -> None:
    collocated = simulated(Problem(periods=200))
    np.testing.assert_array_equal(simulated(Problem(sensor=SensorParameters(delay=0.0), periods=200)), collocated)


@pytest.mark.parametrize("delayed", ["position", "position+rate"])
def test_a_vanishing_delay_tends_to_none(delayed: Any) -> None:
    """Linearly, through delays far shorter than a step."""

    def deviation(delay: float) -> float:
        late = simulated(Problem(sensor=SensorParameters(delay=delay, delayed=delayed), periods=100))
        return float(np.abs(late - undelayed).max())

    undelayed = simulated(Problem(periods=100))
    found = np.array([deviation(delay) for delay in (1e-5, 1e-6, 1e-7)])
    assert 0.0 < found[0] < 1.0  # rad/s, of 30
    np.testing.assert_allclose(found[:-1] / found[1:], 10.0, rtol=0.2)


@pytest.mark.parametrize(("delayed", "gain"), [("position", 1.0), ("position+rate", 0.02)])  # both are stable
@pytest.mark.parametrize("delay", [1.25e-4, 2.5e-4 / 1.5, 2.5e-4, 1e-3])
def test_no_jump_where_a_delay_meets_a_stage_or_a_step(delay: float, delayed: Any, gain: float) -> None:
    """Within a step, at a step and beyond it readings come from different formulas."""
    runs = [
        simulated(Problem(sensor=SensorParameters(delay=delay * (1.0 + e), delayed=delayed), periods=50, gain=gain))
        for e in (-1e-9, 0.0, 1e-9)
    ]
    # a delay's sensitivity is some 1e3 rad/s per s: times 1e-12 s, with room
    assert max(np.abs(runs[0] - runs[1]).max(), np.abs(runs[2] - runs[1]).max()) < 1e-7


def test_a_shared_command_delay_only_shifts_the_run() -> None:
    """x(t; shared) = x(t - delay; none), whatever the joints' own delays: the command's delay is the shoulder's.

    Before the delayed command arrives the arm rests on the corner without error. With a delay of 31 control periods
    the shift is one of the grid, and the two runs differ by rounding in the times of the command alone.
    """
    sensor = SensorParameters(delay=(0.031, 0.0155))
    shifted = simulated(Problem(PAPER, sensor, SHARED, 2031))
    plain = simulated(Problem(sensor=sensor, periods=2000))
    np.testing.assert_allclose(shifted[:32], np.broadcast_to(plain[0], (32, 8)), atol=1e-12)
    np.testing.assert_allclose(shifted[31:], plain, atol=1e-9 * np.ptp(plain, axis=0).max())
    per_joint = simulated(Problem(PAPER, sensor, PER_JOINT, 2031))
    assert np.abs(per_joint[31:] - plain).max() > 0.1  # not so if each joint has a command delay of its own


def test_noise_is_held_over_a_period_and_delayed_by_nothing() -> None:
    """A constant offset of the reading is an opposite offset of the reference."""
    offset = np.array([0.05, -0.03])
    resting = Problem(sensor=END_EFFECTOR, rest_at=-6.3 - 6.3j, periods=300)
    noisy = simulated(replace(resting, noise=np.tile(offset, (300, 1))))
    moved = simulated(replace(resting, rest_at=-6.3 - 6.3j - complex(*offset)))
    np.testing.assert_allclose(noisy, moved, atol=1e-9)
    assert np.abs(noisy - simulated(resting)).max() > 1e-3


def test_a_new_episode_forgets_one_that_diverged() -> None:
    """The law's kernels keep numbers of earlier stages, which are then not finite."""
    problem = Problem(sensor=END_EFFECTOR)
    loop = loop_of(problem)
    fresh = [loop.begin(problem.start_state()), *(loop.advance(1.0) for _ in range(5))]
    loop.advance(1e300)
    assert not np.isfinite(loop.advance(1e300)).all()
    np.testing.assert_array_equal([loop.begin(problem.start_state()), *(loop.advance(1.0) for _ in range(5))], fresh)
