"""Plans for laps on which the payload changes, and the controllers that follow them."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexarm_baselines.joint_space.tracking import JointTracking
from flexarm_baselines.optimal import GOOD, LinearQuadratic, Plan, PlanRegulator, phases
from flexarm_baselines.optimal.phases import plan_phases
from flexarm_baselines.registry import controller, make_controller
from flexarm_baselines.task import Task
from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.parameters import SquareParameters
from flexarm_env.physics.constants import ARM_QUANTITIES
from flexarm_env.physics.paths import stops
from flexarm_env.rollout import run_policy
from tests.support.envs import make
from tests.support.late_arm import plan as small_plan
from tests.support.refusals import refuses

ARM = ArmParameters.linear(modes_per_link=1, payload_mass=0.6)
LAP, CHANGES = 16.0, ((0.2, None), (0.45, 0.1))
SHORT: dict[str, Any] = {"reference": "stops", "payload_changes": CHANGES, "lap_time": LAP}
OPTIONS: dict[str, Any] = {"arm": {"preset": "linear", "modes_per_link": 1, "payload_mass": 0.6}, **SHORT}


def payloads() -> np.ndarray:
    return np.repeat([0.1, np.nan, 0.1], [320, 400, 880])


def planned() -> Plan:
    path = stops(SquareParameters(lap_time=LAP))
    return plan_phases(ARM, path.position(np.minimum(0.01 * np.arange(1601), LAP)), payloads(), "negative")


def test_a_task_knows_what_the_tip_carries_when() -> None:
    task = Task.of(make(**controller("lqg").options, **OPTIONS))
    np.testing.assert_array_equal(task.payloads, payloads())
    assert Task.of(make(**controller("lqg").options)).payloads is None


def test_a_plan_is_the_motion_of_the_environment_whose_payload_changes() -> None:
    """Played open loop with the same step, and kept near the reference, from rest to rest."""
    plan = planned()
    arm = plan.arm
    errors = np.linalg.norm(arm.tip(plan.states[:, : arm.size]) - plan.reference, axis=1)
    assert errors.max() < 5e-3
    np.testing.assert_allclose(plan.replay().states, plan.states, atol=1e-9)
    env = make(**OPTIONS, start="corner", elbow_branch="negative", physics_step=plan.step, error_limit=None)
    actions = iter(plan.torques / plan.limits)
    run = run_policy(env, lambda observation: np.float32(next(actions)), lap="plain", max_steps=880)
    np.testing.assert_allclose(run.state[:880], plan.states[:880], atol=2e-3)  # actions are float32
    assert np.abs(run.state[:880] - PlanRegulator(replace(plan, payloads=None)).plan.replay().states[:880]).max() > 0.1


def test_feedback_of_torques_goes_on_where_the_payload_changes() -> None:
    """A change to the same payload changes nothing."""
    whole, gains = small_plan(), np.full((40, 2, 2), 0.3)
    plan = replace(whole, payloads=np.repeat([np.nan, whole.parameters.payload_mass], 20))
    runs = [one.rollout(plan.arm, plan.states[0], plan.torques, torque_gains=gains) for one in (plan, whole)]
    np.testing.assert_allclose(runs[0].torques, runs[1].torques, rtol=1e-12)
    assert np.abs(runs[0].torques - plan.torques).max() > 1.0


def test_arrays_of_other_numbers_are_converted(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[Any] = []
    monkeypatch.setattr(phases, "_planned", lambda *given: asked.append(given))
    for kind in (np.float64, np.float32):
        plan_phases(ARM, np.ones((3, 2), dtype=kind), np.zeros(2, dtype=kind), "negative")
    assert asked[0] == asked[1]


def test_jacobians_are_those_of_the_arm_of_each_stretch() -> None:
    plan, own = planned(), list(ARM_QUANTITIES).index("payload_mass")
    found = LinearQuadratic.along(plan, GOOD, plan.arm)
    for period, mass in ((100, 0.1), (500, 0.6), (1500, 0.1)):
        arm = FlexibleArm(replace(ARM, payload_mass=mass))
        one = arm.step_jacobians(plan.states[period], plan.torques[period], plan.period, step=plan.step)
        np.testing.assert_allclose(found.by_state[period], one.by_state, rtol=1e-6, atol=1e-9)
        assert np.any(found.by_quantity[period, :, own]) == (mass == 0.6)


def test_feed_forward_is_that_of_the_arm_of_each_stretch() -> None:
    task = Task.of(make(**JointTracking.options(), **OPTIONS))
    found = JointTracking(task).targets(-1.0, 0).torques
    for mass, stretch in ((0.1, slice(0, 300)), (0.6, slice(340, 700)), (0.1, slice(740, 1600))):
        one = replace(task, arm=replace(task.arm, payload_mass=mass), payloads=None)
        np.testing.assert_allclose(found[stretch], JointTracking(one).targets(-1.0, 0).torques[stretch], atol=1e-6)


def test_what_knows_no_changes_is_refused(tmp_path: Path) -> None:
    with refuses(ValueError, "payload_changes", "one payload"):
        make_controller("nmpc", make(**controller("nmpc").options, **OPTIONS))
    with refuses(ValueError, "payloads", "no file"):
        planned().save(tmp_path / "plan.npz")


@pytest.mark.slow
def test_a_payload_that_nobody_knows_is_found_out() -> None:
    """The tip rests more calmly than under the filter of the nominal mass."""
    vibrations = []
    heavy = {"start": "corner", "elbow_branch": "negative", "parameters": {"payload_mass": 1.4}}
    for name in ("lqg", "lqg_adaptive"):
        env = make("FlexArm/Carry-v0", arm={"payload_mass": 0.85}, **controller(name).options)
        run = run_policy(env, make_controller(name, env), options=heavy)
        assert run.notes["ended"] == "truncated"
        second = run.tip[1000:1200]
        vibrations.append(np.linalg.norm(second - second.mean(axis=0), axis=1).max())
    assert vibrations[1] < 0.3 * vibrations[0]
