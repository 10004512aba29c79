"""Exact zeros of one link: the Euler-Bernoulli beam itself, which no number of modes truncates.

A uniform link, hinged at its root with a torque there and free at its tip. Where the deflection plus root rotation of
the point s, its position, stays zero under a vibration exp(sigma t), sigma is a zero of torque -> position of s:

    EI w'''' + rho sigma^2 w = 0,  w(0) = 0,  w''(L) = w'''(L) = 0,  w(s) = 0.

For sigma real, w = cosh and sinh times cos and sin of kappa x with sigma = 2 kappa^2 sqrt(EI / rho). At the tip the
condition is tan(kappa L) + tanh(kappa L) = 0, whose first root 2.3650 is that of a free-free beam's symmetric mode at
half length. For sigma = j omega it is w = cosh, sinh, cos, sin of k x with omega = k^2 sqrt(EI / rho).

Source: Spector & Flashner, *Modeling and design implications of noncollocated control in flexible systems*, ASME J.
Dyn. Syst. Meas. Control 112 (1990), who find these zeros for the pinned-free beam.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from flexarm_env.arm import FlexibleArm
from flexarm_env.validation import integer, number

Array = NDArray[np.float64]
_POINTS_PER_UNIT = 40  # of kappa L in the search for sign changes; roots are about pi / (s / L) >= pi apart
_LARGEST_REAL, _LARGEST_IMAGINARY = 300.0, 30.0  # kappa L, k L; beyond 36 the imaginary ones drown in rounding errors


def link_zeros(arm: FlexibleArm, link: int, position: float, count: int = 3) -> tuple[Array, Array]:
    """First zeros of root torque -> transverse position of a point, of the exact beam.

    Args:
        arm: its uniform link, hinged; lumped masses play no part.
        link: 1 or 2.
        position: s, distance of the point from the root [m], > 0.
        count: how many real and how many imaginary ones, if there are so many with kappa L or k L below 300 or 30.

    Returns:
        The real zeros sigma > 0 (each comes with -sigma) and the magnitudes of the imaginary ones [rad/s]; at the tip
        there are no imaginary ones.

    Raises:
        ValueError: for a point off the link.
    """
    integer("link", link, 1, 2)
    integer("count", count, 1, 20)
    p = arm.parameters
    length = p.link_lengths[link - 1]
    share = number("position", position, "m", above=0.0, most=length) / length
    speed = np.sqrt(p.flexural_rigidities[link - 1] / p.masses_per_length[link - 1]) / length**2
    real = np.array(_roots(lambda z: _deflection(z, share, True), count, _LARGEST_REAL))
    imaginary = np.array(_roots(lambda z: _deflection(z, share, False), count, _LARGEST_IMAGINARY))
    return 2.0 * speed * real**2, speed * imaginary**2


def _deflection(z: float, share: float, decaying: bool) -> float:
    """w(s) of the beam bent by a root torque, up to a positive factor that keeps it finite.

    Args:
        z: kappa L, or k L.
        share: s / L.
        decaying: for a real sigma; else for an imaginary one.
    """
    wave = (1.0 + 1.0j) * z if decaying else z
    # w = cosh - cos + a sinh + b sin of (wave x): w(0) = 0; the free end fixes a and b
    cosh, sinh, cos, sin = np.cosh(wave), np.sinh(wave), np.cos(wave), np.sin(wave)
    matrix = np.array([[sinh, -sin], [cosh, -cos]])
    right = -np.array([cosh + cos, sinh - sin])
    determinant = matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]
    a = right[0] * matrix[1, 1] - matrix[0, 1] * right[1]
    b = matrix[0, 0] * right[1] - right[0] * matrix[1, 0]
    x = wave * share
    value = determinant * (np.cosh(x) - np.cos(x)) + a * np.sinh(x) + b * np.sin(x)
    # for sigma real the beam's own equation is real: value is a real function times a constant phase
    return float((value / (1.0j if decaying else 1.0)).real * np.exp(-2.0 * z))


def _roots(function: Callable[[float], float], count: int, most: float) -> list[float]:
    """First roots from 0.3 to `most`, by sign changes."""
    found: list[float] = []
    z, step = 0.3, 1.0 / _POINTS_PER_UNIT
    before = function(z)
    while len(found) < count and z < most:
        z += step
        now = function(z)
        if before * now < 0.0:
            found.append(float(brentq(function, z - step, z, xtol=1e-13)))
        before = now
    return found
