"""The arm under its law against an independent solution (`oracle`), and what the integrator promises."""

from functools import partial
from typing import Any

import numpy as np
import pytest

from flexarm_env import ArmParameters, LawParameters, SensorParameters
from tests.support.lagrange import loaded_arm, random_state
from tests.support.loops import END_EFFECTOR, NEAR_ELBOW, PER_JOINT, SHARED, arm_of, assert_accurate, loop_of, simulated
from tests.support.oracle import COLLOCATED, PAPER, Problem, oracle
from tests.support.refusals import label

pytestmark = pytest.mark.compiled

SLOW = "slow: others use the same formulas"
PLAIN = "in plain Python: kernels that no other test compiles, and few periods"
Cases = dict[str, tuple[Problem, float, float] | tuple[Problem, float, float, str]]

# Errors are relative to the range of each component over the run, the largest of all instants. The bounds of
# coordinates and rates are about twice what was found, so that a loss of accuracy shows; all but the marked ones
# stay within the project's aim of 1e-3. Largest are the high modes' coordinates after the jump at the start, and
# the rates in the millisecond in which a jump of the command arrives: the law's fastest poles need 0.1 ms for it,
# less than a step.
RNG = np.random.default_rng(2)
UNEQUAL = ArmParameters.linear(
    link_lengths=(5.0, 4.2), masses_per_length=(0.4, 0.3), flexural_rigidities=(2000.0, 1500.0), modes_per_link=2
)
ONE_CORNER = 4300  # control periods
TWO_MODES = Problem(UNEQUAL, SensorParameters(position=4.2), periods=ONE_CORNER)
CHANGING = Problem(sensor=END_EFFECTOR, periods=500, gain=np.repeat(RNG.uniform(0.2, 1.0, 10), 50))
RESTLESS = Problem(sensor=END_EFFECTOR, periods=60, gain=RNG.uniform(0, 2, 60), noise=RNG.normal(0, 0.02, (60, 2)))
MIRRORED = Problem(sensor=END_EFFECTOR, law=LawParameters(80.0, 30.0), periods=ONE_CORNER, clockwise=False, elbow=-1.0)
SMALL_LAP = Problem(sensor=NEAR_ELBOW, periods=1000, side_time=0.25)
PLAIN_CORNERS = Problem(sensor=SensorParameters(rate_jacobian="current"), periods=100, side_time=0.05)
FORESHORTENED = loaded_arm(1, kinematics="foreshortened", link_lengths=(5.0, 4.2))
BENT = partial(Problem, FORESHORTENED, periods=40, gain=0.3, start=random_state(FORESHORTENED, 8, 0.2, 0.5))

CASES: Cases = {
    "paper, collocated, lap": (Problem(), 7e-5, 7e-5, SLOW),
    "paper, end effector, lap": (Problem(sensor=END_EFFECTOR), 2e-4, 2.4e-4, SLOW),
    "paper, 0.5 m, lap": (Problem(sensor=NEAR_ELBOW), 4e-5, 3e-4, SLOW),
    "paper, 0.5 m, small lap": (SMALL_LAP, 4e-5, 3e-4),
    "paper, end effector, shared, one corner": (Problem(PAPER, END_EFFECTOR, SHARED, ONE_CORNER), 3e-4, 3e-4),
    "paper, end effector, per joint, one corner": (Problem(PAPER, END_EFFECTOR, PER_JOINT, ONE_CORNER), 2.5e-4, 3e-4),
    "paper, counterclockwise, negative elbow, other gains": (MIRRORED, 3e-5, 5e-5),
    "paper, current Jacobian": (PLAIN_CORNERS, 2e-4, 2e-4, PLAIN),
    "paper, gain 0.2 to 1 every 50 ms": (CHANGING, 1e-4, 1e-4),
    "paper, gain and noise every ms": (RESTLESS, 2e-4, 2e-4),
    "paper, gain 17": (Problem(periods=ONE_CORNER, gain=17.0), 5e-5, 6e-5),
    "2 modes, gain 17": (Problem(arm_of(2), periods=400, gain=17.0, side_time=0.25), 7e-4, 2.2e-3),
    "2 modes, unequal links, 4.2 m": (TWO_MODES, 4e-4, 4e-4),
    "4 modes, end effector": (Problem(arm_of(4), END_EFFECTOR, periods=ONE_CORNER), 9e-4, 9e-4, SLOW),
    "4 modes, gain 17": (Problem(arm_of(4), periods=ONE_CORNER, gain=17.0), 1.7e-3, 2e-3, SLOW),
    "foreshortened, collocated 3 m": (BENT(SensorParameters("collocated", 3.0)), 3e-7, 3e-7, PLAIN),
    "foreshortened, true sensor, undelayed": (BENT(SensorParameters("true", 3.0, delay=0.0)), 3e-7, 3e-7, PLAIN),
}


@pytest.fixture
def kernels(request: pytest.FixtureRequest) -> None:
    """Run a case's kernels "compiled", or in "plain" Python."""
    if request.param == "plain":
        request.getfixturevalue("uncompiled")


def rows(cases: Cases) -> list[Any]:
    """Return a table's cases as a test's parameters: the problem, two bounds, and how its kernels run."""
    return [
        pytest.param(
            *case[:3], "plain" if PLAIN in case else "compiled", marks=[pytest.mark.slow] * (SLOW in case), id=name
        )
        for name, case in cases.items()
    ]


@pytest.mark.parametrize(("problem", "coordinates", "rates", "kernels"), rows(CASES), indirect=["kernels"])
@pytest.mark.usefixtures("kernels")
def test_agrees_with_the_oracle(problem: Problem, coordinates: float, rates: float) -> None:
    assert_accurate(problem, coordinates, rates)


# Cases that leave the track within milliseconds, or whose right-hand side has kinks at instants of its own. At the
# default step they are less accurate (third bound: the larger of coordinates' and rates'); a step of 25 us shows
# that it is the same equation: nothing but the step separates the two.
FINE_STEP = 2.5e-5
MOVING = np.array([*Problem().start_state()[:4], 3.0, -4.0, 5.0, -5.0])
LATE_RATES, WEAK = partial(SensorParameters, delayed="position+rate"), LawParameters(torque_limit=(100.0, 50.0))
SHAKEN = np.repeat(RNG.normal(0.0, 0.02, (8, 2)), 5, axis=0)
NOISY = Problem(sensor=LATE_RATES("true", position=2.0), noise=SHAKEN, periods=40)
HARD_CASES: Cases = {
    "rates delayed: unstable": (Problem(sensor=LATE_RATES(), periods=60), 2e-5, 1.3e-2),
    "rates delayed by 1.2 ms: unstable": (Problem(sensor=LATE_RATES(delay=1.2e-3), periods=4), 5e-5, 0.14),
    # the feedback's delay times its fastest pole is 1.1: barely stable
    "rates delayed by less than a step": (Problem(sensor=LATE_RATES(delay=1e-4), periods=300), 6e-5, 0.35),
    "true sensor, undelayed": (Problem(sensor=SensorParameters("true", delay=0.0), periods=100), 3e-5, 3e-2, SLOW),
    "true sensor": (Problem(sensor=SensorParameters("true"), periods=80), 1e-5, 1e-2, SLOW),
    "true sensor 2 m past the elbow, late rates, noise": (NOISY, 1e-5, 2e-5, PLAIN),
    "torque limit": (Problem(law=LawParameters(torque_limit=(200.0, 100.0)), periods=1500), 2e-5, 6e-3),
    "low torque limit, delayed": (Problem(PAPER, END_EFFECTOR, WEAK, periods=700), 2e-5, 3e-3),
    # second order at the kinks: 6e-4 found, from 1.4e-2 at the default step
    "torque limit, 2 modes": (Problem(arm_of(2), END_EFFECTOR, WEAK, periods=500), 1.3e-3, 3e-2),
    "moving at the start": (Problem(sensor=END_EFFECTOR, start=MOVING, periods=60), 1e-5, 1.1e-3),
    "delay of whole steps": (Problem(sensor=SensorParameters(delay=(0.031, 0.0155)), periods=1500), 1e-6, 6e-5),
    "delay of one step": (Problem(sensor=SensorParameters(delay=2.5e-4), periods=500), 1e-6, 1e-4),
    "delays of parts of a step": (Problem(sensor=SensorParameters(delay=(3e-4, 1e-4)), periods=500), 1e-6, 1e-4),
}


@pytest.mark.parametrize(("problem", "fine", "default", "kernels"), rows(HARD_CASES), indirect=["kernels"])
@pytest.mark.usefixtures("kernels")
def test_solves_the_oracles_equation(problem: Problem, fine: float, default: float) -> None:
    expected = oracle(problem)
    assert_accurate(problem, fine, fine, FINE_STEP, expected)
    assert_accurate(problem, default, default, None, expected)


# Whole laps; 0 modes stands for the paper's arm. With compensation coordinates are as accurate as without (largest
# found: 9e-4), rates less (up to 2e-3, 4 modes) at the one instant that follows a delayed corner in the same step. Of
# the plain lap, with complete velocity forces and 1 % damping, 6.3e-4 and 8.1e-4 were found (4 modes, 0.5 m). With gain
# 17 the fastest poles reach -4.6e6 /s.
LAPS: dict[str, tuple[list[int], list[SensorParameters], dict[str, Any], float]] = {
    "plain": ([1, 2, 3, 4], [COLLOCATED, END_EFFECTOR, NEAR_ELBOW], {}, 1.3e-3),
    "shared": ([0, 1, 2, 3, 4], [END_EFFECTOR, NEAR_ELBOW], {"law": SHARED}, 3e-3),
    "per joint": ([0, 1, 2, 3, 4], [END_EFFECTOR, NEAR_ELBOW], {"law": PER_JOINT}, 3e-3),
    "gain 17": ([0, 1, 2, 3, 4], [COLLOCATED, END_EFFECTOR], {"gain": 17.0}, 2e-3),
}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "modes", "sensor"),
    [(name, m, s) for name, (ms, ss, *_) in LAPS.items() for m in ms for s in ss],
    ids=label,
)
def test_the_lap_agrees_with_the_oracle(name: str, modes: int, sensor: SensorParameters) -> None:
    *_, options, rates = LAPS[name]
    assert_accurate(Problem(arm_of(modes) if modes else PAPER, sensor, **options), 1e-3, rates)


def test_the_commands_corner_acts_at_its_time_within_a_step() -> None:
    """A corner between two instants of the grid costs no more than one on it.

    Taking a step's command from one side of the corner alone, the first version did, is an error of first order in
    the step: 1.4e-2 of the modal coordinates' range.
    """
    off_grid = Problem(PAPER, SensorParameters(delay=0.0311), SHARED, 500)  # 124.4 steps
    assert_accurate(off_grid, 1e-4, 1e-4)


# Delays in readings and command: from none on, through those shorter than a step.


def test_no_delay_is_the_collocated_loop_bit_for_bit() -> None:
    collocated = simulated(Problem(periods=200))
    np.testing.assert_array_equal(simulated(Problem(sensor=SensorParameters(delay=0.0), periods=200)), collocated)


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


def test_a_new_episode_forgets_one_that_diverged() -> None:
    """The law's kernels keep numbers of earlier stages, which are then not finite."""
    problem = Problem(sensor=END_EFFECTOR)
    loop = loop_of(problem)
    fresh = [loop.begin(problem.start_state()), *(loop.advance(1.0) for _ in range(5))]
    loop.advance(1e300)
    assert not np.isfinite(loop.advance(1e300)).all()
    np.testing.assert_array_equal([loop.begin(problem.start_state()), *(loop.advance(1.0) for _ in range(5))], fresh)
