"""Array types that the baselines share, and how they treat arms of a batch that lost their numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from flexarm_env.simulation.open_loop import LARGEST

Array = npt.NDArray[Any]
Floats = npt.NDArray[np.float64]
Float32s = npt.NDArray[np.float32]
Bools = npt.NDArray[np.bool_]
Integers = npt.NDArray[np.int64]


def is_sound(numbers: Floats, leading: int = 1) -> Bools:
    """Say where all numbers after some leading axes are ones that the arm's equations take."""
    sound: Bools = np.all(np.abs(numbers) <= LARGEST, axis=tuple(range(leading, numbers.ndim)))
    return sound


def chosen_rows(chosen: Bools, one: Floats, other: Floats) -> Floats:
    """Return rows of an array where they are chosen, and those of another elsewhere."""
    return np.where(chosen.reshape(-1, *(1,) * (one.ndim - 1)), one, other)


def product(matrices: Floats, vectors: Floats) -> Floats:
    """Multiply vectors along the last axis by matrices. Shape (..., rows)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def prolonged(table: Floats, more: int) -> Floats:
    """Repeat the last entry of a table of instants."""
    return np.concatenate([table, np.repeat(table[-1:], more, axis=0)])
