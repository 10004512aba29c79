"""The score of a policy on its environment: of both standard laps, or of a race, which counts by its time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import gymnasium

from flexarm_agents.evaluation import scoring
from flexarm_agents.evaluation.scoring import COMPLETE, ERRORS, Score, StandardScore, score
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy

FINISHED = "finished"  # how a race ends whose laps are done
OUT_OF_TIME = "time limit"  # how one ends that lasts as long as it may: it is lost


class RaceScore(Score):
    """Figures of a race: one that was finished counts by its duration, to the control period; it has no errors."""

    @property
    def complete(self) -> bool:
        """The race was finished."""
        return self.ended == FINISHED

    @property
    def rank(self) -> tuple[bool, float]:
        """Smaller is better: finished races by their duration, before all that were not, the longest first."""
        return (False, self.duration) if self.complete else (True, -self.duration)

    def __str__(self) -> str:
        """In one line: the time of the race, or why it was lost."""
        return f"race finished in {self.duration:.2f} s" if self.complete else f"race lost: {self.ended}"


class RaceScores(StandardScore):
    """The score of a race, in the places of both laps."""

    def __str__(self) -> str:
        """In one line: that of the race."""
        return str(self.plain)


def evaluate(env: gymnasium.Env[Any, Any], policy: Any, seed: int = 0) -> StandardScore:
    """Score both standard laps, with deterministic actions; or one race, whose score stands in the places of both.

    Args:
        env: a `FlexArmEnv`, wrapped or not.
        policy: as `run_policy` takes it.
        seed: seed of what is random in the environment, for each lap.
    """
    if not env.unwrapped.settings.mode.races:  # type: ignore[attr-defined]
        return scoring.evaluate(env, policy, seed)
    found = score(run_policy(env, policy, seed=seed))
    if found.ended == COMPLETE:
        errors: dict[str, Any] = dict.fromkeys(ERRORS)
        found = found._replace(ended=OUT_OF_TIME, **errors)
    race = RaceScore(*found)
    return RaceScores(race, race)


def read_score(values: Mapping[str, Any], races: bool = False) -> StandardScore:
    """Read what `StandardScore.as_mapping` gave of laps or a race, with or without more.

    Args:
        values: what it gave.
        races: whether it is of a race; without it only finished races are known to be some.
    """
    if not races and values["plain"]["ended"] != FINISHED:
        return StandardScore.of(values)
    return RaceScores(*(RaceScore.of(values[name]) for name in LAPS))
