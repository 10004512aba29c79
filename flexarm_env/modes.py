"""Clamped-free beam modes: characteristic roots, shapes, and the modal integrals of one link.

Symbols: ``x`` distance from the link's root [m], ``phi_i(x)`` mode shape (scaled by A, so that |phi_i(L)| = 2 A),
``q_i`` modal coordinate; the link's deflection is ``w(x) = sum_i phi_i(x) q_i`` [m] (3).

The paper's printed roots ``(i - 0.5) pi`` are the large-i asymptote and its ``k_i`` lacks parentheses and repeats
sinh; here the roots are exact and ``k_i = (cos + cosh) / (sin + sinh)``. See docs/reproduction.md, errata.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

Array = NDArray[np.float64]

# Gauss-Legendre rule on [0, 1]. The integrands are products of at most two shapes, which oscillate at most twice
# lambda_4 L = 11 rad over the link: 48 nodes integrate them to rounding error.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


@lru_cache
def clamped_free_roots(count: int) -> tuple[float, ...]:
    """First roots of ``cos(z) cosh(z) + 1 = 0``, z = lambda L [rad] (text below (4))."""

    def scaled(z: float) -> float:
        return float(np.cos(z) + 1.0 / np.cosh(z))  # the characteristic equation over cosh: no overflow

    # one root lies in each interval (i pi, (i + 1) pi)
    return tuple(brentq(scaled, i * np.pi, (i + 1) * np.pi, xtol=1e-15, rtol=1e-15) for i in range(count))


@dataclass(frozen=True)
class LinkModes:
    """Modes and modal integrals of one bare link (no hub, no payload).

    Attributes:
        length: L [m].
        scale: A (4).
        wavenumbers: lambda_i [1/m]. Shape (m,).
        frequencies: clamped-free frequencies [rad/s] (5). Shape (m,).
        tip_values: phi_i(L) [m per unit modal coordinate]. Shape (m,).
        tip_slopes: phi_i'(L) [rad per unit modal coordinate]. Shape (m,).
        first_moment: integral of rho phi_i. Shape (m,).
        second_moment: integral of rho x phi_i. Shape (m,).
        mass: integral of rho phi_i phi_j. Shape (m, m), diagonal to rounding error.
        stiffness: integral of EI phi_i'' phi_i''. Shape (m,); the cross terms vanish.
    """

    length: float
    scale: float
    wavenumbers: Array
    frequencies: Array
    tip_values: Array
    tip_slopes: Array
    first_moment: Array
    second_moment: Array
    mass: Array
    stiffness: Array

    def shape(self, x: ArrayLike) -> Array:
        """phi_i at the distances x [m] (4). Shape (..., m)."""
        return _shape(self.wavenumbers, self.length, self.scale, np.asarray(x, dtype=float), 0)

    def slope(self, x: ArrayLike) -> Array:
        """phi_i' at the distances x [m]. Shape (..., m)."""
        return _shape(self.wavenumbers, self.length, self.scale, np.asarray(x, dtype=float), 1)

    def curvature(self, x: ArrayLike) -> Array:
        """phi_i'' at the distances x [m]. Shape (..., m)."""
        return _shape(self.wavenumbers, self.length, self.scale, np.asarray(x, dtype=float), 2)


def _shape(wavenumbers: Array, length: float, scale: float, x: Array, order: int) -> Array:
    """Derivative of the given order of A [cosh - cos - k (sinh - sin)] (lambda x) (4)."""
    z = wavenumbers * length
    k = (np.cos(z) + np.cosh(z)) / (np.sin(z) + np.sinh(z))
    u = x[..., None] * wavenumbers
    cosh, sinh, cos, sin = np.cosh(u), np.sinh(u), np.cos(u), np.sin(u)
    bracket = (
        cosh - cos - k * (sinh - sin),
        sinh + sin - k * (cosh - cos),
        cosh + cos - k * (sinh + sin),
    )[order]
    return scale * wavenumbers**order * bracket


def link_modes(length: float, flexural_rigidity: float, mass_per_length: float, count: int, scale: float) -> LinkModes:
    """Modes and integrals of a uniform link.

    Args:
        length: L [m].
        flexural_rigidity: EI [N m^2].
        mass_per_length: rho [kg/m].
        count: number of modes, m.
        scale: A (4).

    Returns:
        A new `LinkModes`; the arguments are taken as validated (see `ArmParameters`).
    """
    wavenumbers = np.array(clamped_free_roots(count)) / length
    x = _NODES * length
    weight = _WEIGHTS * length
    phi = _shape(wavenumbers, length, scale, x, 0)
    phi_xx = _shape(wavenumbers, length, scale, x, 2)
    end = np.array(length)
    return LinkModes(
        length=length,
        scale=scale,
        wavenumbers=wavenumbers,
        frequencies=wavenumbers**2 * np.sqrt(flexural_rigidity / mass_per_length),  # (5)
        tip_values=_shape(wavenumbers, length, scale, end, 0),
        tip_slopes=_shape(wavenumbers, length, scale, end, 1),
        first_moment=mass_per_length * weight @ phi,
        second_moment=mass_per_length * (weight * x) @ phi,
        mass=mass_per_length * phi.T @ (weight[:, None] * phi),
        stiffness=flexural_rigidity * weight @ phi_xx**2,
    )
