"""`Spread`: one figure over several laps or several trainings, in which an early end cannot hide."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np


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
