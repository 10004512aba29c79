"""How errors, and the spread of several trainings, are written in a table."""

from __future__ import annotations

from flexarm_agents import Spread


def spread_text(spread: Spread, digits: int = 3, scale: float = 1.0) -> str:
    """Write median, interquartile mean and worst of several trainings, scaled; one figure where there is one."""
    values = (spread.median, spread.interquartile_mean, spread.worst)[: 3 if spread.total > 1 else 1]
    return " / ".join("lost" if value is None else f"{scale * value:.{digits}f}" for value in values)


def millimetres(error: Spread | float | None, digits: int = 0) -> str:
    """Write an error [m] of one lap or of several trainings in mm, "lost" where there is none."""
    return spread_text(error if isinstance(error, Spread) else Spread.of([error]), digits, 1e3)
