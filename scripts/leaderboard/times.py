"""How long each row takes to choose an action: measured apart from the cells, which are the same on every machine."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from flexarm_agents.board.rows import Row
from flexarm_env.laps import LAPS
from flexarm_env.predictor import predictor
from scripts.common.markdown import table

LAP = "plain"
FIRST = 10  # control periods that do not count: something may be made at the first call
PERIOD = 10.0  # [ms]


def times(rows: Sequence[Row], tick: Callable[[], Any]) -> dict[str, dict[str, float]]:
    """Time a lap of each row, one observation at a time, in this process.

    Args:
        rows: who is timed.
        tick: called after each row.

    Returns:
        For each row "median" and "p99" of the time from an observation to the action [ms].
    """
    found = {}
    for row in rows:
        taken = np.array(_lap(row)[FIRST:])
        found[row.name] = {"median": float(np.median(taken)), "p99": float(np.percentile(taken, 99.0))}
        tick()
    return found


def _lap(row: Row) -> list[float]:
    """Return the time of each action of a lap, or of as much of it as the row stays on the path [ms]."""
    contender = row.contender(fresh=True)
    predict, env = predictor(contender.policy, deterministic=True), contender.env
    observation, _ = env.reset(seed=0, options=LAPS[LAP].reset_options())
    memory, start, done, taken = None, np.ones(1, dtype=bool), False, []
    while not done:
        begun = time.perf_counter()
        action, memory = predict(observation, memory, start)
        taken.append(1e3 * (time.perf_counter() - begun))
        start = np.zeros(1, dtype=bool)
        observation, _, terminated, truncated, _ = env.step(action)
        done = bool(terminated or truncated)
    env.close()
    return taken


def times_table(found: Mapping[str, Mapping[str, float]]) -> str:
    """Write the times, and what share of a control period the slowest hundredth takes."""
    rows = [
        [name, f"{one['median']:.3f}", f"{one['p99']:.3f}", f"{100.0 * one['p99'] / PERIOD:.1f} %"]
        for name, one in sorted(found.items(), key=lambda item: item[1]["median"])
    ]
    return table(["row", "median [ms]", "99th percentile [ms]", "of the control period"], rows)
