"""The true score of a policy: how well the true tip follows the reference over an episode from the standard start."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import gymnasium
import numpy as np

from flexarm_env.metrics import tracking_error
from flexarm_env.rollout import run_policy
from flexarm_env.simulation.trajectory import Trajectory

COMPLETE = "truncated"  # how an episode ends that lasts as long as it may
SETTLED = 2.0  # [s]; the start's transient is over


class Score(NamedTuple):
    """Figures of one episode; `str` gives the r.m.s. errors, or why and when the episode ended early.

    An episode that ended early is a result of its own: its errors are None, since those of the part before the end
    would compare well with a whole lap's. Figures after 2 s are None for an episode that was shorter, too.

    Attributes:
        ended: "truncated" (a complete episode) or why it ended early.
        duration: until the end [s].
        rms: r.m.s. distance of the true tip from the reference [m].
        maximum: largest such distance [m].
        rms_after_2s: the same from 2 s on [m].
        maximum_after_2s: [m].
        torque_change: change of both torques from one control period to the next, r.m.s. after 2 s [N m].
        peak_deflection: largest deflections of the links' tips [m].
        peak_torque: largest torques of shoulder and elbow [N m].
        episode_return: sum of the rewards.
    """

    ended: str
    duration: float
    rms: float | None
    maximum: float | None
    rms_after_2s: float | None
    maximum_after_2s: float | None
    torque_change: tuple[float, float] | None
    peak_deflection: tuple[float, float]
    peak_torque: tuple[float, float]
    episode_return: float

    @property
    def complete(self) -> bool:
        """The episode lasted as long as it may."""
        return self.ended == COMPLETE

    @property
    def rank(self) -> tuple[bool, float]:
        """Smaller is better: complete episodes by their r.m.s., before all that ended early, the longest first."""
        return (True, -self.duration) if self.rms is None else (False, self.rms)

    def plain(self) -> dict[str, Any]:
        """Return a mapping of plain values for a file."""
        values = {**self._asdict(), "complete": self.complete}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Score:
        """Read what `plain` gave, with or without more."""
        figures: dict[str, Any] = {
            name: tuple(value) if isinstance(value := values[name], list) else value for name in cls._fields
        }
        return cls(**figures)

    def __str__(self) -> str:
        """In one line: the r.m.s. errors of a complete episode; of another, why and when it ended."""
        if self.rms is None:
            return f"ended early: {self.ended} after {self.duration:.2f} s"
        later = "" if self.rms_after_2s is None else f", {self.rms_after_2s:.3f} m after 2 s"
        return f"{self.rms:.3f} m r.m.s. over {self.duration:g} s{later}"


def rank(laps: Sequence[Score]) -> tuple[int, float]:
    """Rank several episodes, smaller is better: how many ended early, then the mean rank of those that decide.

    Args:
        laps: one at least. Where some ended early, these decide.
    """
    early = sum(not lap.complete for lap in laps)
    return early, float(np.mean([lap.rank[1] for lap in laps if lap.complete == (early == 0)]))


def score(run: Trajectory) -> Score:
    """Compute the figures of a policy's run.

    Args:
        run: result of `flexarm_env.rollout.run_policy`.
    """
    ended = str(run.notes.get("ended"))
    settled = run.time >= SETTLED
    whole = tracking_error(run) if ended == COMPLETE else None
    later = tracking_error(run, since=SETTLED) if whole and settled.any() else None
    change = np.diff(run.torque[settled], axis=0)
    rewards = run.reward if run.reward is not None else np.zeros(1)
    return Score(
        ended=ended,
        duration=round(float(run.time[-1]), 9),
        rms=whole.rms if whole else None,
        maximum=whole.maximum if whole else None,
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
        policy: as `run_policy` takes it.
        seed: seed of what is random in the environment.
    """
    return score(run_policy(env, policy, seed=seed))


def _two(values: Any) -> tuple[float, float]:
    return float(values[0]), float(values[1])
