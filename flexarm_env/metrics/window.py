"""The instants of a run that count, and their root mean square."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def rms(values: ArrayLike) -> float:
    """Return the root of the mean square; nan of no values."""
    squares = np.square(values)
    return float(np.sqrt(np.mean(squares))) if squares.size else float("nan")


def instants(time: Array, since: float, until: float) -> NDArray[np.bool_]:
    """Return which instants lie in a window, both ends included; refuse an empty one. Shape (n,)."""
    inside = (time >= since) & (time <= until)
    if not inside.any():
        raise ValueError(f"window = {since} to {until} s: holds no instant; the run covers {time[0]} to {time[-1]} s")
    return inside
