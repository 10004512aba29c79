"""The paper's loop: its linear form, exact margins, an independent spectral method, and the simulation."""

from typing import Any

import numpy as np
import pytest

from flexarm_env import ArmParameters, FlexibleArm, LawParameters, SensorParameters
from flexarm_env.analysis import (
    GainInterval,
    LawLoop,
    crossing_delays,
    delay_margin,
    delay_roots,
    gain_margin,
    law_loop,
    linear_plant,
    stable_gains,
    tip,
    zeros,
)
from flexarm_env.analysis.law_loop import rest_angles
from tests.support.complex_steps import jacobian
from tests.support.envs import vector
from tests.support.loops import resting_at

PAPER, LINEAR = FlexibleArm(ArmParameters.paper()), FlexibleArm(ArmParameters.linear())
CORNER, SIDE = (-6.3, -6.3), (-6.3, 0.0)
DELAYED = ("position", "position+rate")


def loop(delayed: str = "position", position: float = 4.5, arm: FlexibleArm = PAPER, **options: float) -> LawLoop:
    sensor = SensorParameters(position=position, delayed=delayed, **options)  # type: ignore[arg-type]
    return law_loop(arm, CORNER, sensor)


@pytest.mark.parametrize("position", [4.5, 0.5])
@pytest.mark.parametrize(("reference", "branch"), [(CORNER, "positive"), (SIDE, "negative")])
def test_linear_law_is_the_derivative_of_the_law(position: float, reference: tuple[float, float], branch: str) -> None:
    """By the angles now, by late ones, and by the rates; the stretched arm's remaining error included."""
    law = LawParameters()
    case = law_loop(PAPER, reference, SensorParameters(position=position), gain=0.7, elbow_branch=branch)
    assert np.sign(case.point.q[1]) == (0.0 if position == 0.5 else -1.0 if branch == "negative" else 1.0)

    def by_angles(theta: np.ndarray) -> np.ndarray:
        one, both = theta[0], theta[0] + theta[1]
        first, second = 4.5 * np.array([-np.sin(one), np.cos(one)]), position * np.array([-np.sin(both), np.cos(both)])
        return np.column_stack([first + second, second])

    def torque(variables: np.ndarray) -> np.ndarray:
        current, late, rates = np.split(variables, 3)
        one, both = late[0], late[0] + late[1]
        at = 4.5 * np.array([np.cos(one), np.sin(one)]) + position * np.array([np.cos(both), np.sin(both)])
        force = law.proportional_gain * (np.array(reference) - at) - law.derivative_gain * by_angles(late) @ rates
        return np.asarray(0.7 * by_angles(current).T @ force)

    rest = np.concatenate([case.point.q[:2], case.point.q[:2], np.zeros(2)])
    np.testing.assert_allclose(torque(rest), 0.0, atol=1e-9)
    terms = (case.current.P, case.shoulder.P + case.elbow.P, case.current.V)
    expected = np.hstack([-0.7 * term[:, :2] for term in terms])
    np.testing.assert_allclose(jacobian(torque, rest), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("delayed", DELAYED)
@pytest.mark.parametrize(
    ("arm", "options"),
    [
        *((arm, {"position": position}) for arm in (PAPER, LINEAR) for position in (4.5, 0.5)),
        *((PAPER, {"position": position}) for position in (0.3, 2.4, 3.8)),
        (PAPER, {"delay": (0.01, 0.0314)}),
        (PAPER, {"delay": (0.02, 0.0)}),
    ],
)
def test_delay_margin_is_where_the_spectral_method_puts_a_root_on_the_axis(
    arm: FlexibleArm, options: dict[str, Any], delayed: str
) -> None:
    """Of any ratio of delays: no multiples of one, an elbow later than the shoulder, an elbow that is not late.

    At 2.4 and 3.8 m a hardly damped root crosses within a part in a million of its frequency.
    """
    case = loop(delayed, arm=arm, **options)
    margin = delay_margin(case)
    shares = ((0.97, 20), (1.0, 32), (1.03, 20))  # fewer nodes where the sign alone is asked for
    below, at, above = (delay_roots(case.with_delay(s * margin.delay), nodes).rightmost for s, nodes in shares)
    assert abs(at.real) < 1e-6 * abs(at)
    assert abs(at.imag) == pytest.approx(margin.omega, rel=1e-6)
    assert below.real < 0.0 < above.real


@pytest.mark.parametrize(("position", "nodes"), [(4.5, 30), (0.5, 60)])
@pytest.mark.parametrize("delayed", DELAYED)
def test_between_two_crossings_the_spectral_method_has_as_many_growing_roots(
    position: float, nodes: int, delayed: str
) -> None:
    """A pair of roots comes or goes at each crossing: none is left out."""
    case = loop(delayed, position)
    longest = 0.15 if delayed == "position" else 4e-3
    delays = [crossing.delay for crossing in crossing_delays(case, longest)]
    assert delays == sorted(delays)
    ends = np.array([0.5 * delays[0], *delays, 1.01 * delays[-1]])
    roots = [delay_roots(case.with_delay(d), nodes).values for d in 0.5 * (ends[:-1] + ends[1:])]
    growing = np.array([np.sum(found.real > 0.0) for found in roots])
    assert growing[0] == 0
    np.testing.assert_array_equal(np.abs(np.diff(growing)), 2)


@pytest.mark.parametrize("options", [{}, {"delay": 0.03}])
def test_no_proportional_gain_is_no_other_case(options: dict[str, Any]) -> None:
    sensor = SensorParameters(delayed="position+rate", **options)
    none, trace = (law_loop(PAPER, CORNER, sensor, law=LawParameters(proportional_gain=k)) for k in (0.0, 1e-9))
    delays = [[c.delay for c in crossing_delays(case, 0.01)] for case in (none, trace)]
    assert len(delays[0]) > 3
    np.testing.assert_allclose(*delays, rtol=1e-6)
    assert delay_margin(none).delay == 0.0, "it holds the arm nowhere"


@pytest.mark.parametrize("delayed", DELAYED)
def test_margins_are_continuous_in_the_ratio_of_the_delays(delayed: str) -> None:
    for difference in (2e-5, 5e-6, 1e-7):  # the smaller two count as one delay
        one, two = (delay_margin(loop(delayed, delay=(0.03, 0.03 * r))).delay for r in (1.0, 1.0 - difference))  # type: ignore[arg-type]
        assert one == pytest.approx(two, rel=1e-4)


def test_a_loop_in_which_nothing_is_late_has_no_crossings() -> None:
    case = law_loop(PAPER, CORNER, SensorParameters(), law=LawParameters(proportional_gain=0.0))
    assert crossing_delays(case) == []


@pytest.mark.parametrize("modes", [1, 2, 4])
@pytest.mark.parametrize("delay", [0.03, 0.11])
def test_a_shared_late_position_is_stable_at_every_gain(modes: int, delay: float) -> None:
    """T < Kd / Kp = 115 ms: the law stays dissipative, whatever the gain and the number of modes."""
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=modes, damping_ratio=0.0))
    margin = gain_margin(loop(arm=arm, delay=delay))
    assert margin.stable
    assert margin.up == np.inf
    assert margin.down == 0.0


def test_gain_margin_is_where_the_spectral_method_puts_a_root_on_the_axis() -> None:
    """0.5 m past the elbow, per-joint delays: 620 times the gain."""
    case = loop(position=0.5)
    margin = gain_margin(case)
    assert margin.up == pytest.approx(620.45, abs=0.1)
    below, above = (delay_roots(case.with_gain(f * margin.up), 40).rightmost for f in (0.995, 1.005))
    assert below.real < 0.0 < above.real
    assert abs(above.imag) == pytest.approx(margin.omega_up, rel=0.01)


@pytest.mark.parametrize("damping", [0.0187, 0.0561])  # 1 and 3 % of the clamped modes
def test_true_tip_feedback_is_stable_at_small_gains_only(damping: float) -> None:
    """Without delay, by eigenvalues: the right-half-plane zeros draw the poles across."""
    arm = FlexibleArm(ArmParameters.linear(modes_per_link=1, damping_ratio=damping))
    case = law_loop(arm, CORNER, SensorParameters(model="true", delay=0.0))
    (interval,) = stable_gains(case)
    high = interval.high
    assert interval.low == 0.0
    assert 0.02 < high < 0.15
    for gain, sign in ((0.9 * high, -1.0), (1.1 * high, 1.0), (1.0, 1.0), (10.0, 1.0)):
        assert np.sign(case.with_gain(gain).undelayed_poles().real.max()) == sign
    plant = linear_plant(case.point, tip())
    for zero in zeros(plant).right_half_plane:
        distance = [np.abs(case.with_gain(gain).undelayed_poles() - zero).min() for gain in (1e1, 1e3, 1e5)]
        assert distance[0] > distance[1] > distance[2], "poles end on the zeros"
        assert distance[2] < 2.0


def test_late_rates_leave_a_damped_arm_a_trace_of_gain_and_an_undamped_one_none() -> None:
    assert stable_gains(loop("position+rate")) == []
    case = loop("position+rate", arm=LINEAR)
    ((low, high),) = ((interval.low, interval.high) for interval in stable_gains(case))
    assert low == 0.0
    assert high == pytest.approx(0.00295, rel=0.01)
    below, above = (delay_roots(case.with_gain(share * high), 30).rightmost for share in (0.98, 1.02))
    assert below.real < 0.0 < above.real


def test_slope_of_the_loop_is_its_derivative() -> None:
    for delayed in DELAYED:
        case = loop(delayed)
        omega, step = np.array([3.0, 40.0, 900.0]), 1e-5
        difference = (case.loop_transfer(omega + step) - case.loop_transfer(omega - step)) / (2j * step)
        np.testing.assert_allclose(case.loop_slope(omega), difference, rtol=1e-5, atol=1e-9)


def test_a_collocated_loop_is_stable_at_every_gain() -> None:
    """Hyperstability: a passive arm under a dissipative law."""
    for arm in (PAPER, FlexibleArm(ArmParameters.linear(modes_per_link=4, damping_ratio=0.0))):
        case = law_loop(arm, CORNER, SensorParameters(model="collocated"))
        assert stable_gains(case) == [GainInterval(0.0, np.inf)]
        for gain in (1e-3, 1.0, 1e2):
            assert case.with_gain(gain).undelayed_poles().real.max() < 0.0


def test_a_loop_without_delay_has_its_poles_as_roots() -> None:
    case = loop(delay=0.0)
    np.testing.assert_allclose(delay_roots(case).values.real, np.sort(case.undelayed_poles().real)[::-1])


@pytest.mark.parametrize(("delayed", "duration", "step"), [("position", 20.0, None), ("position+rate", 0.4, 2e-5)])
def test_simulated_loop_grows_beyond_the_margin_only(delayed: str, duration: float, step: float | None) -> None:
    """Held on a corner and pushed: 10 % below the delay margin it calms down, 10 % above it grows."""
    case = loop(delayed)
    margin = delay_margin(case).delay
    pairs = [(float(d), float(d / 2)) for d in np.array([0.9, 1.1]) * margin]
    options = resting_at(*CORNER) | {"max_episode_steps": -1, "delayed": delayed, "physics_step": step}
    simulation = vector("FlexArm/Paper-v0", 2, per_env={"delay": pairs}, **options)
    state = np.zeros(2 * PAPER.size)
    state[:2] = rest_angles(PAPER, CORNER, 4.5, "positive")[0]
    state[0] += 1e-6
    simulation.reset(options={"state": state})
    sizes, lost = [], np.zeros(2, dtype=bool)
    for _ in range(round(duration / 1e-3)):
        _, _, terminated, _, infos = simulation.step(np.ones((2, 1), dtype=np.float32))
        lost |= terminated
        sizes.append(np.abs(infos["state"][:, PAPER.size : PAPER.size + 2]).max(axis=1))
    half = len(sizes) // 2
    early, late = np.max(sizes[half // 2 : half], axis=0), np.max(sizes[-half // 2 :], axis=0)
    assert not lost[0]
    assert late[0] < early[0]
    assert lost[1] or late[1] > early[1]
