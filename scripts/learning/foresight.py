"""The schedule of gains with perfect foresight: the best one found for a lap that is known beforehand.

A schedule is linear between knots. The tip's errors at all instants are fitted in the sense of least squares by the
gains at the knots (`scipy.optimize.least_squares`), with difference quotients from one batch of laps. It begins with
the best constant gain, and the number of knots doubles from level to level.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from flexarm_agents import Score, score
from flexarm_agents.environments import make_batch, make_one
from flexarm_env.actions import action_from_gain
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy
from scripts.common.result_files import write_json

Floats = NDArray[np.float64]
LEVELS = (10, 20, 40, 80, 160)  # intervals between knots
EVALUATIONS = 25  # of the errors, at most, on a level
INCREMENT = 1e-4  # of a gain, in difference quotients
LOST = 3.0  # [m], the error after a lap's early end
CONSTANTS = tuple(round(0.01 * n, 2) for n in range(1, 101))


@dataclass(frozen=True)
class Plant:
    """An environment whose action is the gain.

    Attributes:
        environment: id.
        options: options that differ.
    """

    environment: str
    options: Mapping[str, Any]

    def errors(self, gains: Floats, lap: str) -> Floats:
        """Run a lap with each of several schedules, in one batch.

        Args:
            gains: in each control period. Shape (n, T).
            lap: name of the lap.

        Returns:
            Tip minus reference at the end of each period [m]. Shape (n, T, 2).
        """
        count, periods = gains.shape
        env = make_batch(self.environment, count, {**self.options, "max_episode_steps": periods + 1})
        actions = action_from_gain(gains, env.gain_limit)[:, :, None].astype(np.float32)
        env.reset(seed=0, options=LAPS[lap].reset_options())
        found, live = np.full((count, periods, 2), LOST / np.sqrt(2.0)), np.ones(count, dtype=bool)
        for n in range(periods):
            _, _, terminated, _, infos = env.step(actions[:, n])
            live &= ~terminated
            found[live, n] = (infos["true_tip"] - infos["reference"])[live]
        env.close()
        return found

    def score(self, policy: Any, lap: str) -> Score:
        """Score a policy on a lap."""
        env = make_one(self.environment, self.options)
        found = score(run_policy(env, policy, seed=0, lap=lap))
        env.close()
        return found

    @property
    def periods(self) -> int:
        """Control periods of a lap."""
        env = make_one(self.environment, self.options)
        count: int = env.unwrapped.lap_steps  # type: ignore[attr-defined]
        env.close()
        return count


@dataclass(frozen=True)
class Schedule:
    """A policy that commands gains by the clock alone.

    Attributes:
        knots: gains at evenly spaced instants, from the lap's begin to its end.
        periods: control periods of the lap.
        gain_limit: gain that the action 1 stands for.
    """

    knots: tuple[float, ...]
    periods: int
    gain_limit: float = 1.0

    @cached_property
    def actions(self) -> NDArray[np.float32]:
        """Action in each period, by the gain at its middle. Shape (T, 1)."""
        gains = np.asarray(self.knots) @ weights(len(self.knots) - 1, self.periods)
        return action_from_gain(gains, self.gain_limit)[:, None].astype(np.float32)

    def predict(
        self, observation: Any, state: tuple[int, ...] | None = None, episode_start: Any = None
    ) -> tuple[NDArray[np.float32], tuple[int, ...]]:
        """Return the action of the next period; the state counts periods."""
        (now,) = (0,) if state is None else state
        return self.actions[now], (now + 1,)


@dataclass(frozen=True)
class Search:
    """What was found for a lap.

    Attributes:
        constant: the best constant gain for this lap.
        knots: gains at the knots of each level, in the order of `LEVELS`.
    """

    constant: float
    knots: tuple[tuple[float, ...], ...]


def weights(intervals: int, periods: int) -> Floats:
    """Return the share that each knot has in the gain of each period. Shape (intervals + 1, periods)."""
    places = np.linspace(0.0, periods, intervals + 1)
    middles = np.arange(periods) + 0.5
    return np.stack([np.interp(middles, places, unit) for unit in np.eye(intervals + 1)])


def rms(errors: Floats) -> Floats:
    """Return the r.m.s. distance [m] of errors of shape (..., T, 2)."""
    return np.sqrt((errors**2).sum(axis=-1).mean(axis=-1))


def constant_errors(plant: Plant, lap: str) -> Floats:
    """Return the r.m.s. error with each of `CONSTANTS` [m]."""
    return rms(plant.errors(np.repeat(np.array(CONSTANTS)[:, None], plant.periods, axis=1), lap))


def search(plant: Plant, lap: str, levels: Iterable[int]) -> Search:
    """Find the best schedule of a lap on each level.

    Args:
        plant: the environment.
        lap: name of the lap.
        levels: numbers of intervals between knots, increasing.
    """
    constant = CONSTANTS[int(np.argmin(constant_errors(plant, lap)))]
    knots, found = np.full(2, constant), []
    for intervals in levels:
        start = np.interp(np.linspace(0.0, 1.0, intervals + 1), np.linspace(0.0, 1.0, len(knots)), knots)
        knots = _fitted(plant, lap, start)
        found.append(tuple(float(f"{gain:.9g}") for gain in knots))
    return Search(constant, tuple(found))


def _fitted(plant: Plant, lap: str, start: Floats) -> Floats:
    """Fit the gains at the knots by least squares."""
    periods = plant.periods
    share = weights(len(start) - 1, periods)

    def residuals(knots: Floats) -> Floats:
        return plant.errors((knots @ share)[None], lap).ravel() / np.sqrt(periods)

    def slopes(knots: Floats) -> Floats:
        steps = np.where(knots + INCREMENT > 1.0, -INCREMENT, INCREMENT)
        several = np.concatenate([knots[None], knots + np.diag(steps)])
        errors = plant.errors(several @ share, lap).reshape(len(several), -1) / np.sqrt(periods)
        return np.asarray(((errors[1:] - errors[0]) / steps[:, None]).T)

    inside = np.clip(start, 1e-6, 1.0 - 1e-6)
    return np.asarray(least_squares(residuals, inside, slopes, (0.0, 1.0), ftol=1e-4, max_nfev=EVALUATIONS).x)


def kept_search(plant: Plant, lap: str, path: Path) -> Search:
    """Return what `search` finds; the file keeps it with what it was found for.

    Raises:
        ValueError: if the file has another search.
    """
    question = json.loads(json.dumps({**asdict(plant), "lap": lap, "levels": LEVELS, "evaluations": EVALUATIONS}))
    if path.is_file():
        content = json.loads(path.read_text())
        if content["question"] != question:
            raise ValueError(f"{path}: has the schedule of another environment or search; remove it")
        return Search(content["constant"], tuple(tuple(one) for one in content["knots"]))
    found = search(plant, lap, LEVELS)
    path.parent.mkdir(parents=True, exist_ok=True)
    write_json(path, {"question": question, **asdict(found)})
    return found
