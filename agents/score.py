"""The true score of a policy: how well the true tip follows the reference over an episode from the standard start."""

from __future__ import annotations

from typing import Any, NamedTuple

import gymnasium
import numpy as np

from flexarm_env.metrics import tracking_error
from flexarm_env.rollout import run_policy
from flexarm_env.simulation.trajectory import Trajectory

SETTLED = 2.0  # [s]; the start's transient is over


class Score(NamedTuple):
    """Figures of one episode; those after 2 s are None for one that ended before.

    Attributes:
        ended: "truncated" (a complete episode) or why it ended early.
        duration: [s].
        rms: r.m.s. distance of the true tip from the reference [m].
        maximum: largest such distance [m].
        rms_after_2s: the same from 2 s on [m].
        maximum_after_2s: [m].
        torque_change: of shoulder and elbow from one control period to the next, r.m.s. after 2 s [N m].
        peak_deflection: of the links' tips [m].
        peak_torque: of shoulder and elbow [N m].
        episode_return: sum of the rewards.
    """

    ended: str
    duration: float
    rms: float
    maximum: float
    rms_after_2s: float | None
    maximum_after_2s: float | None
    torque_change: tuple[float, float] | None
    peak_deflection: tuple[float, float]
    peak_torque: tuple[float, float]
    episode_return: float

    @property
    def complete(self) -> bool:
        """The episode lasted as long as it may."""
        return self.ended == "truncated"

    @property
    def rank(self) -> tuple[bool, float]:
        """Smaller is better: complete episodes by their r.m.s., before all that ended early, the longest first."""
        return (False, self.rms) if self.complete else (True, -self.duration)

    def plain(self) -> dict[str, Any]:
        """For a file: a mapping of plain values."""
        values = {**self._asdict(), "complete": self.complete}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}


def score(run: Trajectory) -> Score:
    """Figures of a policy's run.

    Args:
        run: of `flexarm_env.rollout.run_policy`.
    """
    whole = tracking_error(run)
    settled = run.time >= SETTLED
    later = tracking_error(run, since=SETTLED) if settled.any() else None
    change = np.diff(run.torque[settled], axis=0)
    rewards = run.reward if run.reward is not None else np.zeros(1)
    return Score(
        ended=str(run.notes.get("ended")),
        duration=round(float(run.time[-1]), 9),
        rms=whole.rms,
        maximum=whole.maximum,
        rms_after_2s=later.rms if later else None,
        maximum_after_2s=later.maximum if later else None,
        torque_change=_two(np.sqrt(np.mean(change**2, axis=0))) if len(change) else None,
        peak_deflection=_two(np.abs(run.tip_deflection).max(axis=0)),
        peak_torque=_two(np.abs(run.torque).max(axis=0)),
        episode_return=float(rewards.sum()),
    )


def evaluate(env: gymnasium.Env[Any, Any], policy: Any, seed: int = 0) -> Score:
    """Score of one episode from the standard start, with deterministic actions.

    Args:
        env: a `FlexArmEnv`, wrapped or not.
        policy: anything with stable-baselines3's ``predict``.
        seed: of what is random in the environment.
    """
    return score(run_policy(env, policy, seed=seed))


def _two(values: Any) -> tuple[float, float]:
    return float(values[0]), float(values[1])
