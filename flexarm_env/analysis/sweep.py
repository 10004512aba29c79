"""The sweep over frequency that every search for crossings makes: its grid, and bisection of many intervals at once.

Source: Gu, Kharitonov & Chen, *Stability of time-delay systems* (2003), ch. 4 (frequency sweeping).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from flexarm_env.analysis.law_loop import LawLoop
from flexarm_env.analysis.natural import natural_modes

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Bools = NDArray[np.bool_]

# The grid of frequencies: from far below the loop's slowest motion, near 1 rad/s, to far beyond its fastest pole.
LOWEST, BEYOND, PER_DECADE = 1e-2, 30.0, 100
NEAREST = 1e-8  # relative: an undelayed root's damping may be a millionth of its frequency
BISECTIONS = 52  # to the last bit


def frequencies(loop: LawLoop) -> Array:
    """Lay a grid over the loop's frequencies, dense about the arm's own, free and locked, and the undelayed loop's.

    None is exactly the arm's own, where the loop transfer has its poles.
    """
    near = np.concatenate([-np.geomspace(0.05, NEAREST, 40), np.geomspace(NEAREST, 0.05, 40)])
    own = np.concatenate([natural_modes(loop.point, joints).frequencies for joints in ("free", "locked")])
    poles = loop.undelayed_poles()
    highest = BEYOND * max(float(np.abs(poles).max()), float(own.max()))
    swinging = poles.imag[poles.imag > LOWEST]
    grid = np.geomspace(LOWEST, highest, int(PER_DECADE * np.log10(highest / LOWEST)))
    about = np.outer(np.concatenate([own[own > 0.0], swinging]), 1.0 + near)
    return np.unique(np.concatenate([grid, about], axis=None))


def bisected(before: Callable[[Array], Bools], low: Array, high: Array) -> Array:
    """Return where conditions change, by bisection of all intervals at once. Shape (k,).

    Args:
        before: function of frequencies, one in each interval: whether the change is still ahead.
        low: lower end of each interval. Shape (k,).
        high: upper end of each interval. Shape (k,).
    """
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        left = before(middle)
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    return low


def determinant(matrices: Complex) -> Complex:
    """Return the determinants of 2 x 2 matrices. Shape (..., 2, 2) to (...,)."""
    return np.asarray(matrices[..., 0, 0] * matrices[..., 1, 1] - matrices[..., 0, 1] * matrices[..., 1, 0])


def mixed(a: Complex, b: Complex) -> Complex:
    """Return det(a + b) - det(a) - det(b)."""
    return np.asarray(
        a[..., 0, 0] * b[..., 1, 1]
        + a[..., 1, 1] * b[..., 0, 0]
        - a[..., 0, 1] * b[..., 1, 0]
        - a[..., 1, 0] * b[..., 0, 1]
    )
