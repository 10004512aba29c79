"""The privileged yardstick: the best plan known under feedback of the true state."""

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_baselines.optimal import load_plan
from flexarm_baselines.optimal.library import mirrored, moved_onto, plans_for, turned
from flexarm_baselines.plan_follower import PlanFollower
from flexarm_baselines.task import Task
from flexarm_env import FlexibleArm, SquareParameters, square
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy

ID = "flexarm_env:FlexArm/Square-v0"
PLAIN = load_plan("default_plain")
BLOCKS = {"state": slice(0, 2 * FlexibleArm(PLAIN.parameters).size), "lap_phase": slice(2, 4)}


def task(**changes: Any) -> Task:
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


def test_moved_plans_are_runs_of_the_arm() -> None:
    first = PLAIN.replay().states[:50]
    for moved in (turned(PLAIN, 0.7), mirrored(PLAIN, 0.3)):
        found = moved.replay().states[:50]
        np.testing.assert_allclose(found, moved.states[:50], atol=1e-6)
        tips = PLAIN.arm.tip(found[:, : PLAIN.arm.size]) - moved.reference[:50]
        own = PLAIN.arm.tip(first[:, : PLAIN.arm.size]) - PLAIN.reference[:50]
        np.testing.assert_allclose(np.linalg.norm(tips, axis=1), np.linalg.norm(own, axis=1), atol=1e-6)


def test_plans_are_found_by_their_reference() -> None:
    limits = PLAIN.limits
    for changes in ({}, {"direction": "counterclockwise"}, {"start_corner": "upper right"}):
        found = dict(plans_for(PLAIN.parameters, reference(**changes), 0.01, limits))
        assert set(found) == {"default_plain", "default_swing"}
        for plan in found.values():
            np.testing.assert_allclose(plan.reference, reference(**changes), atol=1e-6)
    assert plans_for(PLAIN.parameters, reference(), 0.01, (100.0, 50.0)) == ()
    assert plans_for(PLAIN.parameters, reference(side=12.0), 0.01, limits) == ()
    assert plans_for(replace(PLAIN.parameters, payload_mass=0.1), reference(), 0.01, limits) == ()
    assert moved_onto(PLAIN, reference(side=12.0)) is None


def test_refusals() -> None:
    with pytest.raises(ValueError, match="no plan for this arm, reference, control period and torque limit"):
        PlanFollower(task(torque_limit=(100.0, 50.0)))
    with pytest.raises(ValueError, match=r"plans\[0\]: must have 1600 periods of 0\.01 s, has 1599"):
        PlanFollower(
            task(),
            [replace(PLAIN, torques=PLAIN.torques[1:], states=PLAIN.states[1:], reference=PLAIN.reference[1:])],
        )
    with pytest.raises(ValueError, match="must hold one at least"):
        PlanFollower(task(), [])
