"""The standard score of a policy: how well the true tip follows the reference over each of the two standard laps.

`Spread`: one figure over several laps or several trainings, in which an early end cannot hide.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import gymnasium
import numpy as np

from flexarm_env.laps import LAPS
from flexarm_env.metrics import figures_so_far
from flexarm_env.rollout import run_policy
from flexarm_env.simulation.trajectory import Trajectory

COMPLETE = "truncated"  # how an episode ends that lasts as long as it may
ERRORS = ("rms", "maximum", "rms_after_2s", "maximum_after_2s")  # of `LapFigures`, for complete episodes only


class Score(NamedTuple):
    """Figures of one episode (`flexarm_env.metrics.LapFigures`); `str` gives its errors, or when and why it was lost.

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
        elbow_changes: how often the elbow changed sides (`flexarm_env.metrics.elbow_changes`).
        peak_deflection: largest deflections of the links' tips [m].
        peak_torque: largest torques of shoulder and elbow until the last instant [N m].
        episode_return: sum of the rewards.
    """

    ended: str
    duration: float
    rms: float | None
    maximum: float | None
    rms_after_2s: float | None
    maximum_after_2s: float | None
    torque_change: tuple[float, float] | None
    elbow_changes: int
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

    def as_mapping(self) -> dict[str, Any]:
        """Return a mapping of plain values for a file."""
        values = {**self._asdict(), "complete": self.complete}
        return {name: list(value) if isinstance(value, tuple) else value for name, value in values.items()}

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> Score:
        """Read what `as_mapping` gave, with or without more."""
        figures: dict[str, Any] = {
            name: tuple(value) if isinstance(value := values[name], list) else value for name in cls._fields
        }
        return cls(**figures)

    def __str__(self) -> str:
        """In one line: the errors of a complete episode; of another, why and when it ended."""
        if self.rms is None or self.maximum is None:
            return f"lost after {self.duration:.2f} s: {self.ended}"
        later = "" if self.rms_after_2s is None else f", {metres(self.rms_after_2s)} m after 2 s"
        return f"{metres(self.rms)} m r.m.s. over {self.duration:g} s{later}, {metres(self.maximum)} m at most"


def metres(value: float) -> str:
    """Write an error in metres: to the millimetre, below a centimetre (laboratory arms) with two digits."""
    return f"{value:.3f}" if value >= 0.01 else f"{value:.2g}"


class StandardScore(NamedTuple):
    """Scores of the two standard laps, by their names (`flexarm_env.laps.LAPS`).

    Attributes:
        swing: figures of the swing lap.
        plain: figures of the plain lap.
    """

    swing: Score
    plain: Score

    @property
    def complete(self) -> bool:
        """Both laps are complete."""
        return all(lap.complete for lap in self)

    def as_mapping(self) -> dict[str, dict[str, Any]]:
        """Return a mapping of plain values for a file."""
        return {name: lap.as_mapping() for name, lap in self._asdict().items()}

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> StandardScore:
        """Read what `as_mapping` gave, with or without more."""
        return cls(**{name: Score.of(values[name]) for name in LAPS})

    def __str__(self) -> str:
        """In one line: each lap's name and `str`."""
        return "; ".join(f"{name} lap: {lap}" for name, lap in self._asdict().items())


def rank(scores: Iterable[StandardScore]) -> tuple[int, float]:
    """Rank standard scores, smaller is better: how many laps ended early, then the mean rank of those that decide.

    Args:
        scores: one at least. Where some laps ended early, these decide; else the mean of all laps' r.m.s. errors.
    """
    laps = [lap for score in scores for lap in score]
    early = sum(not lap.complete for lap in laps)
    return early, float(np.mean([lap.rank[1] for lap in laps if lap.complete == (early == 0)]))


def score(run: Trajectory) -> Score:
    """Compute the figures of a policy's run.

    Args:
        run: result of `flexarm_env.rollout.run_policy`.
    """
    ended = str(run.notes.get("ended"))
    figures = figures_so_far(run)
    errors = {name: getattr(figures, name) if ended == COMPLETE else None for name in ERRORS}
    rewards = run.reward if run.reward is not None else np.zeros(1)
    return Score(
        ended=ended,
        duration=round(float(run.time[-1]), 9),
        **errors,
        torque_change=figures.torque_change_after_2s,
        elbow_changes=len(figures.elbow_changes),
        peak_deflection=figures.peak_deflection,
        peak_torque=figures.peak_torque,
        episode_return=float(rewards.sum()),
    )


def evaluate(env: gymnasium.Env[Any, Any], policy: Any, seed: int = 0) -> StandardScore:
    """Score both standard laps, with deterministic actions.

    Args:
        env: a `FlexArmEnv`, wrapped or not.
        policy: as `run_policy` takes it.
        seed: seed of what is random in the environment, for each lap.
    """
    return StandardScore(**{name: score(run_policy(env, policy, seed=seed, lap=name)) for name in LAPS})


class Spread(NamedTuple):
    """A figure of which less is better; where it is missing, since a lap ended early, it counts as infinite.

    The statistics are None where they are infinite for that reason.

    Attributes:
        total: laps or trainings.
        complete: those that have the figure.
        median: median of all.
        interquartile_mean: mean of the middle half; a quarter of them, rounded down, is cut off at each end.
        best: the least one.
        worst: the largest one.
    """

    total: int
    complete: int
    median: float | None
    interquartile_mean: float | None
    best: float | None
    worst: float | None

    @classmethod
    def of(cls, figures: Iterable[float | None]) -> Spread:
        """Compute the spread of at least one figure; None stands for a missing one."""
        values = np.sort([np.inf if figure is None else figure for figure in figures])
        cut = len(values) // 4
        statistics = (np.median(values), values[cut : len(values) - cut].mean(), values[0], values[-1])
        return cls(len(values), int(np.isfinite(values).sum()), *(_finite(value) for value in statistics))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
