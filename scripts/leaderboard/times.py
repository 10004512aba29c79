"""How long each row takes to choose an action: measured apart from the cells, which are the same on every machine."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from flexarm_agents.board.rows import Row
from scripts.common.markdown import table
from scripts.common.period_times import period_times

PERIOD = 10.0  # [ms]


def times(rows: Sequence[Row], tick: Callable[[], Any]) -> dict[str, dict[str, float]]:
    """Time a lap of each entry, one observation at a time, in this process.

    Args:
        rows: who is timed.
        tick: called after each row.

    Returns:
        For each row "median" and "p99" of the processor time from an observation to the action [ms].
    """
    found = {}
    for row in rows:
        contender = row.contender(fresh=True)
        taken = period_times(contender.env, contender.policy)
        contender.env.close()
        found[row.name] = {"median": float(np.median(taken)), "p99": float(np.percentile(taken, 99.0))}
        tick()
    return found


def times_table(found: Mapping[str, Mapping[str, float]]) -> str:
    """Write the times, and what share of a control period the slowest hundredth takes."""
    rows = [
        [name, f"{one['median']:.3f}", f"{one['p99']:.3f}", f"{100.0 * one['p99'] / PERIOD:.1f} %"]
        for name, one in sorted(found.items(), key=lambda item: item[1]["median"])
    ]
    return table(["entry", "median [ms]", "99th percentile [ms]", "of the control period"], rows)
