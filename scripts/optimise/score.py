"""What a plan scores in the environment, as any policy is scored."""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

import flexarm_env  # noqa: F401  (registers the environments)
from flexarm_baselines.optimal import Plan
from flexarm_env.metrics import summary
from flexarm_env.rollout import run_policy

FIGURES = ("true_tip_rms", "true_tip_rms_after_2s", "true_tip_max", "elbow_changes", "vibration")


def score(plan: Plan, lap: str, reference: Mapping[str, Any]) -> dict[str, Any]:
    """Run a plan through `FlexArm/Square-v0`, open loop, with options of its reference; return figures of the lap."""
    own = {"torque_limit": plan.limits, "physics_step": plan.step, "max_episode_steps": len(plan.torques)}
    env = gymnasium.make("FlexArm/Square-v0", **{**reference, **own, "arm": asdict(plan.parameters)})
    actions = iter((plan.torques / np.array(plan.limits)).astype(np.float32))
    figures = summary(run_policy(env, lambda observation: next(actions), lap=lap))
    if figures["ended_early"]:
        raise RuntimeError(f"the plan of the {lap} lap ends the episode: {figures['ended']}")
    return {name: figures[name] for name in FIGURES} | efforts(plan)


def tip_errors(plan: Plan) -> NDArray[np.float64]:
    """Return the distance of the plan's tip from its reference at each instant [m]. Shape (n + 1,)."""
    return np.linalg.norm(plan.arm.tip(plan.states[:, : plan.arm.size]) - plan.reference, axis=1)


def efforts(plan: Plan) -> dict[str, Any]:
    """Return r.m.s. torques and their r.m.s. changes from period to period [N m]."""
    changes = np.diff(plan.torques, axis=0)
    return {
        "torque_rms": np.sqrt(np.mean(plan.torques**2, axis=0)).tolist(),
        "torque_change_rms": np.sqrt(np.mean(changes**2, axis=0)).tolist(),
    }


def solved(plan: Plan) -> dict[str, Any]:
    """Return `efforts`, and how far the solver came."""
    notes = plan.notes
    return {**efforts(plan), "converged": notes["converged"], "residual": notes["log"]["residual"][-1]}
