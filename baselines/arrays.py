"""Array types and functions that the baselines share; some are for batches of which single arms have diverged."""

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
    """Say where all numbers have magnitudes that the arm's equations take (`LARGEST`). Shape: the leading axes."""
    sound: Bools = np.all(np.abs(numbers) <= LARGEST, axis=tuple(range(leading, numbers.ndim)))
    return sound


def chosen_rows(chosen: Bools, one: Floats, other: Floats) -> Floats:
    """Return the rows of `one` where `chosen` is true, and those of `other` elsewhere. Shape as `one`."""
    return np.where(chosen.reshape(-1, *(1,) * (one.ndim - 1)), one, other)


def product(matrices: Floats, vectors: Floats) -> Floats:
    """Multiply vectors along the last axis by matrices. Shape (..., rows)."""
    return np.asarray((matrices @ vectors[..., None])[..., 0])


def prolonged(table: Floats, more: int) -> Floats:
    """Append the last entry of a table of instants (its first axis) `more` times."""
    return np.concatenate([table, np.repeat(table[-1:], more, axis=0)])
