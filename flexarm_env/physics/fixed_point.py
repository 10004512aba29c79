"""Fixed points of functions, for equilibria."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def fixed_point(function: Callable[[Array], Array], start: Array) -> Array:
    """Return x with function(x) = x, by damped repetition.

    Args:
        function: of arrays of the shape of `start`.
        start: first guess.

    Raises:
        RuntimeError: if it does not settle.
    """
    x = start.copy()
    for _ in range(300):
        change = function(x) - x
        x += 0.5 * change
        if np.abs(change).max() < 1e-12:
            return x
    raise RuntimeError("the shape under this force was not found: it bends too far")
