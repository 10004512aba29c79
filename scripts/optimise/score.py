"""What a plan scores in the environment, as any policy is scored."""

from __future__ import annotations

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


class Replay:
    """A policy that plays a plan's torques, open loop."""

    def __init__(self, plan: Plan) -> None:
        """Take the plan's torques as actions."""
        self.actions = (plan.torques / np.array(plan.limits)).astype(np.float32)

    def predict(
        self, observation: Any, state: Any = None, episode_start: Any = None, deterministic: bool = True
    ) -> tuple[NDArray[np.float32], int]:
        """Return the action of the next control period; the state counts them."""
        period = 0 if state is None else int(state)
        return self.actions[period], period + 1


def score(plan: Plan, lap: str) -> dict[str, Any]:
    """Run a plan open loop through `FlexArm/Square-v0`, and return the figures of its lap."""
    env = gymnasium.make("FlexArm/Square-v0", arm=asdict(plan.parameters), torque_limit=plan.limits)
    run = run_policy(env, Replay(plan), lap=lap)
    figures = summary(run)
    return {name: figures[name] for name in FIGURES} | efforts(plan)


def efforts(plan: Plan) -> dict[str, Any]:
    """Return r.m.s. torques and their r.m.s. changes from period to period [N m]."""
    changes = np.diff(plan.torques, axis=0)
    return {
        "torque_rms": np.sqrt(np.mean(plan.torques**2, axis=0)).tolist(),
        "torque_change_rms": np.sqrt(np.mean(changes**2, axis=0)).tolist(),
    }
