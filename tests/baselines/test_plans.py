"""Plans: their files, feedback along them, and the controller that follows them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_baselines.optimal import AGGRESSIVE, Plan, PlanRegulator, RegulatorWeights, load_plan
from flexarm_baselines.optimal.library import moved_onto, plans_for
from flexarm_baselines.plan_follower import PlanFollower
from flexarm_baselines.task import Task
from flexarm_env import ArmParameters, FlexibleArm, SquareParameters, square
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy
from tests.support.late_arm import ARM, SIZE, START
from tests.support.optimal import PERIODS, plan, problem, solved
from tests.support.refusals import refused


def test_a_plan_replays_to_its_states_and_survives_a_file(tmp_path: Path) -> None:
    plan().save(tmp_path / "plan.npz")
    loaded = Plan.load(tmp_path / "plan.npz")
    for name in ("states", "torques", "reference"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(plan(), name))
    assert (loaded.parameters, loaded.limits, loaded.period, loaded.step) == (ARM.parameters, (40.0, 12.0), 0.01, 1e-3)
    assert loaded.notes["note"] == "a test's"
    assert loaded.notes["log"]["residual"][-1] < 1e-7
    np.testing.assert_array_equal(loaded.replay().states, plan().states)


def test_the_gains_are_those_of_the_riccati_recursion() -> None:
    weights = RegulatorWeights(tip=0.02, speed=0.3, torque=(10.0, 4.0))
    regulator = PlanRegulator(plan(), weights)
    found = ARM.step_jacobians(plan().states[:-1], plan().torques)
    slopes = ARM.output_jacobians(plan().states)[1].sensed / np.array([0.02, 0.02, 0.3, 0.3])[:, None]
    torque_cost, value = np.diag(1.0 / np.array([10.0, 4.0]) ** 2), slopes[-1].T @ slopes[-1]
    more = 200
    order = [*range(PERIODS), *[PERIODS - 1] * more]
    for n, t in reversed(list(enumerate(order))):
        A, B = found.by_state[t], found.by_torque[t]
        gain = -np.linalg.solve(torque_cost + B.T @ value @ B, B.T @ value @ A)
        closed, output = A + B @ gain, slopes[t if n < PERIODS else -1]
        value = output.T @ output + gain.T @ torque_cost @ gain + closed.T @ value @ closed
        if n < PERIODS:
            np.testing.assert_allclose(regulator.gains[t], gain, rtol=1e-5, atol=1e-5)


def test_the_torque_is_that_of_the_rollout() -> None:
    regulator = PlanRegulator(plan())
    state = plan().states[0] + 0.01
    run = regulator.rollout(state)
    for t in (0, 3, PERIODS - 1):
        np.testing.assert_allclose(regulator.torque(0.01 * t, run.states[t]), run.torques[t], atol=1e-9)
        np.testing.assert_allclose(regulator.torque(0.01 * t + 0.004, run.states[t]), run.torques[t], atol=1e-9)
    assert regulator.torque(0.1, np.tile(state, (3, 1))).shape == (3, 2)
    np.testing.assert_array_equal(regulator.torque(9.0, state), regulator.torque(0.24, state))
    np.testing.assert_array_equal(regulator.torque(-1.0, state), regulator.torque(0.0, state))


def test_feedback_brings_the_tip_back_and_more_of_it_sooner() -> None:
    wide = Plan.of(problem(limits=(400.0, 200.0)), solved()[1])
    off = np.array([0.002, -0.003, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    misses = []
    for regulator in (None, PlanRegulator(wide), PlanRegulator(wide, AGGRESSIVE)):
        start = wide.states[0] + off
        run = ARM.rollout(start, wide.torques) if regulator is None else regulator.rollout(start)
        misses.append(np.linalg.norm(ARM.tip(run.states[:, :4]) - ARM.tip(wide.states[:, :4]), axis=1))
    assert misses[1][-1] < 0.5 * misses[0][-1]
    assert np.sum(misses[2] ** 2) < np.sum(misses[1] ** 2)


def test_another_arm_and_drawn_quantities_are_run() -> None:
    regulator = PlanRegulator(plan())
    heavy = FlexibleArm(ArmParameters.linear(modes_per_link=1, payload_mass=0.3))
    one, other = regulator.rollout(arm=heavy), regulator.rollout(payload_mass=[0.0, 0.3])
    assert other.states.shape == (2, PERIODS + 1, SIZE)
    np.testing.assert_allclose(other.states[1], one.states, atol=1e-9)


TWO_MODES = FlexibleArm(ArmParameters.linear())
TABLES = np.zeros((3, 8)), np.zeros((3, 2)), np.zeros((4, 2))  # of different lengths


test_bad_input_along_a_plan_is_refused = refused(
    (lambda: load_plan("best"), "name = 'best'"),
    (lambda: PlanRegulator(solved()[1]), "TypeError: plan = "),
    (lambda: PlanRegulator(plan(), (0.1, 0.2)), "TypeError: weights = "),
    (lambda: RegulatorWeights(torque=(0.0, 1.0)), "torque"),
    (lambda: PlanRegulator(plan(), model=TWO_MODES), "2 modes a link, the plan's 1"),
    (lambda: PlanRegulator(plan(), model="x"), "TypeError: model = 'x'"),  # type: ignore[arg-type]
    (lambda: replace(plan(), payloads=np.zeros(3)), r"payloads: must have shape \(\d+,\), got \(3,\)"),
    (lambda: PlanRegulator(plan()).torque(0.0, np.zeros(4)), r"state: must have shape \(..., 8\)"),
    (lambda: PlanRegulator(plan()).torque(np.nan, START), "time = nan"),
    (lambda: Plan(ARM.parameters, *TABLES, (1.0, 1.0), 0.01, 1e-3), "states: must have shape"),
)


# --- the privileged yardstick: the best plan known under feedback of the true state ----------------------------------


ID = "flexarm_env:FlexArm/Square-v0"
PLAIN = load_plan("default_plain")
BLOCKS = {"state": slice(0, 2 * FlexibleArm(PLAIN.parameters).size), "lap_phase": slice(2, 4)}


def task_of_plan(**changes: Any) -> Task:
    return replace(Task(PLAIN.parameters, square(SquareParameters()), blocks=BLOCKS), **changes)


def reference(**changes: Any) -> np.ndarray:
    return square(SquareParameters(**changes)).position(np.minimum(PLAIN.time, 16.0))


@pytest.mark.parametrize("direction", ["clockwise", "counterclockwise"])
@pytest.mark.parametrize("lap", LAPS)
def test_it_follows_the_plan_of_each_lap_in_both_directions(lap: str, direction: str) -> None:
    env = gymnasium.make(ID, direction=direction, **PlanFollower.options())
    run = run_policy(env, PlanFollower.for_env(env), lap=lap, max_steps=120)
    plan = load_plan(f"default_{lap}")
    error = np.linalg.norm(run.tip - run.reference, axis=1)
    planned = np.linalg.norm(plan.arm.tip(plan.states[:121, : plan.arm.size]) - plan.reference[:121], axis=1)
    np.testing.assert_allclose(error, planned, atol=1e-3)  # the environment's steps are twice as long


@pytest.mark.parametrize("lap", LAPS)
def test_blended_corners_have_a_plan_of_their_own(lap: str) -> None:
    """It passes the first corner, at 4 s, to a tenth of a millimetre; a sharp one leaves 14 cm."""
    env = gymnasium.make("flexarm_env:FlexArm/SmoothSquare-v0", physics_step=1e-3, **PlanFollower.options())
    run = run_policy(env, PlanFollower.for_env(env), lap=lap, max_steps=450)
    assert np.linalg.norm(run.tip - run.reference, axis=1)[200:].max() < 5e-4


def test_plans_are_found_by_their_reference() -> None:
    limits = PLAIN.limits
    for changes in ({}, {"direction": "counterclockwise"}, {"start_corner": "upper right"}):
        found = dict(plans_for(PLAIN.parameters, reference(**changes), 0.01, limits))
        assert set(found) == {"default_plain", "default_swing"}
        for one in found.values():
            np.testing.assert_allclose(one.reference, reference(**changes), atol=1e-6)
    assert plans_for(PLAIN.parameters, reference(), 0.01, (100.0, 50.0)) == ()
    assert plans_for(PLAIN.parameters, reference(side=12.0), 0.01, limits) == ()
    assert plans_for(replace(PLAIN.parameters, payload_mass=0.1), reference(), 0.01, limits) == ()
    assert moved_onto(PLAIN, reference(side=12.0)) is None


LATER = {name: getattr(PLAIN, name)[1:] for name in ("torques", "states", "reference")}
test_plans_that_do_not_fit_are_refused = refused(
    (lambda: PlanFollower(task_of_plan(torque_limit=(100.0, 50.0))), r"no plan for .*period and torque limit"),
    (lambda: PlanFollower(task_of_plan(), [replace(PLAIN, **LATER)]), r"plans\[0\]: must .* 1600 .* 0\.01 s, has 1599"),
    (
        lambda: PlanFollower(task_of_plan(), [replace(PLAIN, reference=PLAIN.reference + 1e-3)]),
        r"plans\[0\]: must be along the task's reference, its own is up to 0\.001 m off",
    ),
    (lambda: PlanFollower(task_of_plan(), []), "must hold one at least"),
)
