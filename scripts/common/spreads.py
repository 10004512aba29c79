"""How the spread of several trainings is written in a table."""

from __future__ import annotations

from flexarm_agents import Spread


def spread_text(spread: Spread, digits: int = 3) -> str:
    """Write median, interquartile mean and worst of several trainings; one figure where there is one."""
    values = (spread.median, spread.interquartile_mean, spread.worst)[: 3 if spread.total > 1 else 1]
    return " / ".join("lost" if value is None else f"{value:.{digits}f}" for value in values)
