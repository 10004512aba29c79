"""LQG and its adaptive form on unknown arms, which each episode draws anew, beside feedback of the true state."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import gymnasium
import numpy as np

from flexarm_baselines.registry import controller
from flexarm_env.envs.registration import UNKNOWN_PLANT
from flexarm_env.laps import LAPS, SETTLED
from scripts.common.markdown import table
from scripts.control.trials import Study

ENVIRONMENT = "flexarm_env:FlexArm/Square-v0"
EPISODES = 256
ROWS = {
    "LQG": "lqg",
    "adaptive LQG": "lqg_adaptive",
    "true state in place of a filter": "plan_lqr",
}


class Errors(NamedTuple):
    """Errors of the episodes of one lap.

    Attributes:
        rms: over the lap; NaN where the path was lost [m].
        later: after 2 s [m].
    """

    rms: list[float]
    later: list[float]

    @property
    def lost(self) -> int:
        """Number of episodes that ended early."""
        return int(np.isnan(self.rms).sum())


class UnknownScore(NamedTuple):
    """Errors by lap, as `laps.LAPS` has them."""

    swing: Errors
    plain: Errors

    def as_mapping(self) -> dict[str, Any]:
        """Return a mapping of plain values for a file; what was lost has None."""
        return {
            lap: {name: [None if np.isnan(x) else x for x in values] for name, values in errors._asdict().items()}
            for lap, errors in self._asdict().items()
        }


@dataclass(frozen=True)
class UnknownTrial:
    """A controller in many episodes, every second one of which is a swing lap.

    Attributes:
        controller: its name in the registry.
        design: keyword arguments of its `for_env`.
        seed: of the episodes.
    """

    controller: str
    design: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0

    def score(self) -> UnknownScore:
        """Run them side by side."""
        entry = controller(self.controller)
        envs = gymnasium.make_vec(ENVIRONMENT, num_envs=EPISODES, **entry.options | UNKNOWN_PLANT)
        policy = entry.make(envs, **self.design)
        sides = [lap.elbow_branch for lap in LAPS.values()] * (EPISODES // len(LAPS))
        observations, infos = envs.reset(seed=self.seed, options={"start": "corner", "elbow_branch": sides})
        squares, running, state = [infos["tip_error"] ** 2], np.ones(EPISODES, dtype=bool), None
        starting = np.ones(EPISODES, dtype=bool)
        over = np.zeros(EPISODES, dtype=bool)
        while not over.all():
            actions, state = policy.predict(observations, state, starting)
            observations, _, terminated, truncated, infos = envs.step(actions)
            starting, running = terminated | truncated, running & ~terminated
            squares.append(np.where(running, infos["tip_error"] ** 2, np.nan))
            over |= starting
        envs.close()
        settled = round(SETTLED / 0.01)
        whole, later = (np.sqrt(np.mean(part, axis=0)) for part in (np.array(squares), np.array(squares[settled:])))
        laps = len(LAPS)
        return UnknownScore(*(Errors(whole[lap::laps].tolist(), later[lap::laps].tolist()) for lap in range(laps)))


def trials(quick: bool) -> dict[str, UnknownTrial]:
    """Return each row."""
    return {row: UnknownTrial(name) for row, name in list(ROWS.items())[: 1 if quick else None]}


def rows(scores: dict[str, UnknownScore]) -> str:
    """Write the table, a line for each lap: errors over the lap / after 2 s."""
    head = ["", "lap", "lost", "mean [mm]", "worst [mm]"]
    lines = []
    for row, score in scores.items():
        for lap, errors in score._asdict().items():
            kept = np.array([pair for pair in zip(*errors, strict=True) if not np.isnan(pair[0])])
            figures = (np.mean(kept, axis=0), np.max(kept, axis=0)) if len(kept) else ()
            cells = [f"{1e3 * whole:.1f} / {1e3 * later:.1f}" for whole, later in figures] or [""] * 2
            lines.append([row, lap, f"{errors.lost} of {len(errors.rms)}", *cells])
    return table(head, lines)


STUDY = Study("LQG on unknown arms: r.m.s. over the lap / after 2 s [mm]", trials, rows, "lqg.md")
