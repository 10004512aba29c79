"""Predictive control: an iteration beside the solver's, what lies beyond the horizon, and runs on a small arm."""

from dataclasses import replace
from functools import cache
from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_baselines.arrays import is_sound
from flexarm_baselines.optimal import Plan, Solution, SolverOptions, TrackingProblem, optimise
from flexarm_baselines.optimal.laps import DEFLECTION
from flexarm_baselines.predictive import (
    NMPC,
    UNKNOWN,
    GaugedNMPC,
    Instant,
    RealTimeIteration,
    ReferenceRun,
    StampedNMPC,
    StateNMPC,
    previewed,
)
from flexarm_env.rollout import run_policy
from flexarm_env.simulation.feedback import Rollout
from tests.support.late_arm import ARM, BLOCKS, LIMITS, PERIODS, PLACES, SIZE, START, Plant, off_plan, task
from tests.support.refusals import refused

WEIGHT = 3e-3  # [m^2], on changes of the torques


def problem(**changes: Any) -> TrackingProblem:
    options: dict[str, Any] = {"change_weight": WEIGHT, "deflection_limit": DEFLECTION, "limits": LIMITS}
    return TrackingProblem(ARM, START, task().reference, **(options | changes))


@cache
def solved() -> Solution:
    return optimise(problem(), ARM.rollout(START, np.zeros((PERIODS, 2))), SolverOptions(tolerance=1e-8))


@cache
def plan() -> Plan:
    return Plan.of(problem(), solved())


def iteration(plan: Plan, horizon: int, damping: float = 0.0) -> RealTimeIteration:
    runs = ReferenceRun.along([plan], ARM, horizon, change_weight=WEIGHT)
    return RealTimeIteration(ARM, runs, horizon, LIMITS, 0.01, 1e-3, damping)


def at(period: int, states: np.ndarray, torques: np.ndarray) -> Instant:
    before = torques[period - 1] if period else np.zeros(2)
    return Instant(np.array([0]), np.array([period]), states[period][None], before[None], {})


def one(states: np.ndarray, torques: np.ndarray) -> Rollout:
    return Rollout(states[None], torques[None])


def improved(iteration: RealTimeIteration, prediction: Rollout, now: Instant) -> Rollout:
    """Return a better prediction of a single arm, without its leading axis."""
    return Rollout(*(part[0] for part in iteration.improve(prediction, now)))


def test_it_is_an_iteration_of_the_solver() -> None:
    """Over the whole run, from a run that is no optimum; 0.1 is the regularisation of the solver's first iteration."""
    start = ARM.rollout(START, np.tile([3.0, -1.0], (PERIODS, 1)))
    found = optimise(problem(), start, SolverOptions(iterations=1))
    own = iteration(Plan(ARM.parameters, *start, task().reference, LIMITS, 0.01, 1e-3), PERIODS, damping=0.1)
    better = improved(own, one(*start), at(0, *start))
    assert np.abs(better.torques - start.torques).max() > 1.0
    np.testing.assert_allclose(better.torques, found.run.torques, atol=1e-6)
    np.testing.assert_allclose(better.states, found.run.states, atol=1e-8)


@pytest.mark.parametrize("period", [0, 7, PERIODS - 5])
def test_a_short_horizon_knows_what_follows(period: int) -> None:
    """On the best run nothing is to be improved, however near the horizon; it may reach beyond the end."""
    states, torques = solved().run
    own = iteration(plan(), 10)
    now = at(period, states, torques)
    better = improved(own, own.predicted(now.run, now.period), now)
    length = min(10, PERIODS - period)
    np.testing.assert_allclose(better.torques[:length], torques[period : period + length], atol=0.1)


@pytest.mark.parametrize("off", [1.0, 1e150])
def test_the_guide_leads_back_a_prediction_that_went_astray(off: float) -> None:
    states, torques = solved().run
    own = iteration(plan(), 15)
    lost = one(np.minimum(states[:16] + off, 1e12), torques[:15])
    for _ in range(3):
        lost = own.improve(lost, at(0, states, torques))
    np.testing.assert_allclose(lost.torques[0], torques[:15], atol=0.05)


def test_limits_are_kept() -> None:
    states, torques = solved().run
    own = iteration(plan(), 20)
    away = at(0, states, torques)._replace(state=START[None] + np.array([0.5, -0.5, 0, 0, 0, 0, 0, 0]))
    better = own.improve(one(states[:21], torques[:20]), away)
    assert np.all(np.abs(better.torques) <= LIMITS)
    assert np.any(np.abs(better.torques) >= np.array(LIMITS) - 1e-9)
    assert better.states[:, 0].tolist() == away.state.tolist()
    shifted = own.shifted(better, away)
    assert np.all(np.abs(shifted.torques) <= LIMITS)
    np.testing.assert_array_equal(shifted.states[:, :-1], better.states[:, 1:])


def test_a_preview_alone_gives_runs_on_both_sides() -> None:
    plans = previewed(ARM, task().reference, LIMITS, 0.01)
    assert [np.sign(found.states[0, 1]) for found in plans] == [1.0, -1.0]
    for found in plans:
        error = ARM.tip(found.states[:, :4]) - found.reference
        assert np.abs(error[-1]).max() < 0.1
        assert np.all(np.abs(found.torques) <= LIMITS)


def controller(kind: Any = NMPC, **design: Any) -> Any:
    return kind(task(), plans=[plan()], horizon=0.1, change_weight=WEIGHT, **design)


@pytest.mark.parametrize("kind", [NMPC, GaugedNMPC, StateNMPC])
def test_on_the_plan_it_stays_on_the_plan(kind: type[NMPC]) -> None:
    assert np.abs(off_plan(controller(kind), Plant(START[None]), plan())[..., :4]).max() < 1e-3


@pytest.mark.parametrize("kind", [NMPC, StateNMPC])
def test_it_brings_the_arm_back(kind: type[NMPC]) -> None:
    start = START[None] + np.array([0.02, -0.02, 0, 0, 0, 0, 0, 0])
    off = off_plan(controller(kind), Plant(start), plan())
    tip = ARM.tip(plan().states[1:-1, :4] + off[:, 0, :4]) - ARM.tip(plan().states[1:-1, :4])
    assert np.linalg.norm(tip[0]) > 0.05
    assert np.linalg.norm(tip[-5:], axis=1).max() < 0.02


def test_it_knows_that_the_tip_is_late() -> None:
    """A filter that takes the late tip for the present one is far off on the way; that with the delay is not."""
    wrong = []
    for told in (task(), replace(task(), delay=0.0)):
        following = NMPC(told, plans=[plan()], horizon=0.1)
        plant = Plant(START[None])
        *_, (_, state) = plant.driven(following, 25)
        believed = state[4][0, :SIZE]
        wrong.append(np.linalg.norm(ARM.tip(believed[:4]) - ARM.tip(plant.states[0, :4])))
    assert wrong[0] < 2e-3
    assert wrong[1] > 5.0 * wrong[0]


def test_it_finds_an_unknown_payload_and_delay() -> None:
    following = controller(unknown={"payload_mass": 0.3, "delay": 0.01})
    *_, (_, state) = Plant(START[None], delay=0.034, payload_mass=np.array([0.2])).driven(following, PERIODS - 1)
    assert state[4][0, SIZE] == pytest.approx(0.2, abs=0.05)
    assert state[4][0, SIZE + 1] == pytest.approx(0.034, abs=2e-3)


def test_an_estimate_that_lost_its_numbers_begins_anew() -> None:
    following = controller(unknown=UNKNOWN)
    plant = Plant(np.tile(START, (2, 1)))
    for k, (action, state) in enumerate(plant.driven(following, 8)):
        assert np.isfinite(action).all()
        assert all(np.isfinite(part).all() for part in state)
        if k == 3:
            state[4][0] = np.nan
            state[5][0] = np.inf
    np.testing.assert_allclose(plant.states[0, :2], plant.states[1, :2], atol=0.05)


@pytest.mark.parametrize("since", [0, 3])
@pytest.mark.parametrize("block", ["joint_angles", "lap_phase", "state", None])
@pytest.mark.parametrize("kind", [NMPC, StateNMPC])
def test_observations_without_numbers_are_of_one_arm_alone(kind: type[NMPC], block: str | None, since: int) -> None:
    following = controller(kind)
    torques = []
    for spoilt in (False, True):
        plant, state = Plant(np.tile(START, (2, 1))), None
        for k in range(5):
            observation = plant.observe()
            if spoilt and k >= since:
                observation[0, BLOCKS[block] if block else slice(None)] = np.nan
            action, state = following.predict(observation, state)
            assert np.isfinite(action).all()
            plant.step(action)
            torques.append(action[1])
    np.testing.assert_array_equal(torques[:5], torques[5:])


def test_an_estimate_that_loses_its_numbers_on_the_way_begins_anew() -> None:
    """Its rates are such that the model has no next state."""
    following = controller()
    plant = Plant(np.tile(START, (2, 1)))
    _, state = following.predict(plant.observe())
    fast = state[4].copy()
    fast[0, SIZE // 2 : SIZE] = 1e11
    good, lost = (following.advance((mean, *state[5:]), np.zeros((2, 2))) for mean in (state[4], fast))
    assert not is_sound(lost[0])[0]
    for one, other in zip(good, lost, strict=True):
        np.testing.assert_array_equal(other[1], one[1])
    assert np.isfinite(following.predict(plant.observe(), (*state[:4], *lost))[0]).all()


@pytest.mark.parametrize("kind", [NMPC, StateNMPC])
def test_a_whole_turn_changes_nothing(kind: type[NMPC]) -> None:
    observation = Plant(START[None] + 0.01).observe()
    turned = observation.copy()
    turned[:, [0, 12]] += 2.0 * np.pi
    following = controller(kind)
    assert following.predict(turned)[0] == pytest.approx(following.predict(observation)[0], abs=1e-6)


test_refusals = refused(
    (lambda: NMPC(task(), plans=[plan()], horizon=0.123), r"horizon = 0\.123: .* control periods of 0\.01 s"),
    (lambda: NMPC(task(), reference="way"), "reference = 'way': must be one of"),
    (lambda: controller(iterations=0), "iterations = 0"),
    (lambda: controller(damping=-1.0), "damping"),
    (lambda: controller(step=0.0), r"step = 0\.0: must be a finite number and > 0"),
    (lambda: StampedNMPC(task(), unknown={"payload_mass": 0.5}), r"unknown = .*: must have 'delay'"),
    (lambda: controller(unknown={"mass": 1.0}), r"quantities = 'mass'"),
    (lambda: NMPC(replace(task(), sensor="rigid")), "sensor = 'rigid': must be 'true'"),
    (lambda: NMPC(task()), "the package has no plan for this arm"),
    (
        lambda: GaugedNMPC(replace(task(), blocks={name: BLOCKS[name] for name in PLACES}), plans=[plan()]),
        "GaugedNMPC reads the block 'modal_coordinates'",
    ),
)


@pytest.mark.parametrize("limit", [1.2, 0.9])
def test_the_deflection_is_constrained(limit: float) -> None:
    """The best plan of the swing lap bends link 1 by 1.4 m at the start; with a lower limit the arm stays below it."""
    env = gymnasium.make("flexarm_env:FlexArm/Square-v0", **NMPC.options())
    run = run_policy(env, NMPC.for_env(env, deflection_limit=limit), lap="swing", max_steps=50)
    assert np.abs(run.tip_deflection).max() == pytest.approx(limit, abs=0.01)  # soft: a few millimetres beyond it
