"""How errors, and the spread of several trainings, are written in a table."""

from __future__ import annotations

from flexarm_agents import Spread


def spread_text(spread: Spread, digits: int = 3, scale: float = 1.0) -> str:
    """Write median, interquartile mean and worst of several trainings; one figure where there is one.

    Args:
        spread: of a figure that is missing where a lap was lost.
        digits: behind the point.
        scale: by which each figure is multiplied.
    """
    values = (spread.median, spread.interquartile_mean, spread.worst)[: 3 if spread.total > 1 else 1]
    return " / ".join("lost" if value is None else f"{scale * value:.{digits}f}" for value in values)


def millimetres(error: Spread | float | None, digits: int = 0) -> str:
    """Write an error in mm: of several trainings as `spread_text` does, "lost" where there is none.

    Args:
        error: of one lap, or of several trainings [m].
        digits: behind the point.
    """
    return spread_text(error if isinstance(error, Spread) else Spread.of([error]), digits, 1e3)
