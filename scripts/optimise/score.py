"""What a plan scores in the environment, as any policy is scored."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import gymnasium
import numpy as np

import flexarm_env  # noqa: F401  (registers the environments)
from flexarm_baselines.optimal import Plan, PlanRegulator
from flexarm_env.laps import LAPS
from flexarm_env.metrics import summary

FIGURES = ("true_tip_rms", "true_tip_rms_after_2s", "true_tip_max", "elbow_changes", "vibration")


def score(plan: Plan, lap: str) -> dict[str, Any]:
    """Run a plan through `FlexArm/Square-v0` under feedback of the true state, and return the figures of its lap.

    An environment's actions are of single precision, and the arm's motion along a lap is so sensitive that torques
    rounded to that leave the plan after some seconds without feedback.
    """
    env = gymnasium.make("FlexArm/Square-v0", arm=asdict(plan.parameters), torque_limit=plan.limits)
    regulator, time = PlanRegulator(plan), plan.time.tolist()
    _, info = env.reset(options=LAPS[lap].reset_options())
    states, torques, references = [info["state"]], [], [info["reference"]]
    for instant in time[:-1]:
        torque = regulator.torque(instant, states[-1])
        _, _, terminated, _, info = env.step((torque / plan.limits).astype(np.float32))
        if terminated:
            raise RuntimeError(f"the plan of the {lap} lap ends the episode after {info['time']:.2f} s")
        states.append(info["state"])
        torques.append(info["torque"])
        references.append(info["reference"])
    run = plan.arm.record(
        plan.time, np.array(states), np.array([*torques, torques[-1]]), reference=np.array(references)
    )
    figures = summary(run)
    return {name: figures[name] for name in FIGURES} | efforts(plan)


def efforts(plan: Plan) -> dict[str, Any]:
    """Return r.m.s. torques and their r.m.s. changes from period to period [N m]."""
    changes = np.diff(plan.torques, axis=0)
    return {
        "torque_rms": np.sqrt(np.mean(plan.torques**2, axis=0)).tolist(),
        "torque_change_rms": np.sqrt(np.mean(changes**2, axis=0)).tolist(),
    }
