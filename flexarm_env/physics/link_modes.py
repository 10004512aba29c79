"""Admissible shapes of one link, clamped at its root and free at its tip, and the link's modal integrals.

Symbols: ``x`` distance from the link's root [m], ``phi_i(x)`` mode shape (scaled by A, so that |phi_i(L)| = 2 A),
``q_i`` modal coordinate; the link's deflection is ``w(x) = sum_i phi_i(x) q_i`` [m] (3).

Two sets of shapes: "cantilever", the clamped-free beam's own modes (4), whose curvature vanishes at the tip, where
the elbow's moment bends the real link 1; and "polynomial", the Rayleigh-Ritz modes of the same beam in the space of
x^2 to x^(m+1), which can carry a moment there.

Sources: Blevins, *Formulas for natural frequency and mode shape* (1979), table 8-1; for the polynomials the method of
Bhat, J. Sound Vib. 102 (1985), with the orthogonality of Jacobi's, Abramowitz & Stegun 22.2.1.

The paper's printed roots ``(i - 0.5) pi`` are the large-i asymptote and its ``k_i`` lacks parentheses and repeats
sinh; here the roots are exact and ``k_i = (cos + cosh) / (sin + sinh)``. See docs/reproduction.md, errata.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import comb

import numpy as np
from numpy.polynomial import Polynomial, polynomial
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Gauss-Legendre rule on [0, 1]. The integrands are products of at most four shapes or slopes, which oscillate at most
# four times lambda_4 L = 11 rad over the link: 48 nodes integrate them to rounding error.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(48)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


@lru_cache
def clamped_free_roots(count: int) -> tuple[float, ...]:
    """Return the first roots of ``cos(z) cosh(z) + 1 = 0``, z = lambda L [rad] (text below (4))."""
    from scipy.optimize import brentq  # its import would take much of an environment's start

    def scaled(z: float) -> float:
        return float(np.cos(z) + 1.0 / np.cosh(z))  # the characteristic equation over cosh: no overflow

    # one root lies in each interval (i pi, (i + 1) pi)
    return tuple(brentq(scaled, i * np.pi, (i + 1) * np.pi, xtol=1e-15, rtol=1e-15) for i in range(count))


class CantileverShapes:
    """The clamped-free beam's modes A [cosh - cos - k (sinh - sin)] (lambda x) (4).

    Attributes:
        wavenumbers: lambda_i [1/m]. Shape (m,).
    """

    def __init__(self, length: float, count: int, scale: float) -> None:
        self._length, self._scale = length, scale
        self.wavenumbers = np.array(clamped_free_roots(count)) / length

    def __call__(self, x: Array, order: int) -> Array:
        """Return the derivative of an order at the distances x [m]. Shape (..., m)."""
        z = self.wavenumbers * self._length
        k = (np.cos(z) + np.cosh(z)) / (np.sin(z) + np.sinh(z))
        u = x[..., None] * self.wavenumbers
        cosh, sinh, cos, sin = np.cosh(u), np.sinh(u), np.cos(u), np.sin(u)
        bracket = (
            cosh - cos - k * (sinh - sin),
            sinh + sin - k * (cosh - cos),
            cosh + cos - k * (sinh + sin),
        )[order]
        return self._scale * self.wavenumbers**order * bracket


class PolynomialShapes:
    """The Rayleigh-Ritz modes of that beam in the space of x^2 to x^(m+1).

    With xi = x / L, xi^2 times the Jacobi polynomials P_j^(0,4)(2 xi - 1), whose weight is xi^4, are orthogonal. Their
    coefficients are the whole numbers (-1)^(j-k) (j over k) (j + k + 4 over j), Abramowitz & Stegun 22.3.2.

    Attributes:
        wavenumbers: lambda_i [1/m]. Shape (m,).
    """

    def __init__(self, length: float, count: int, scale: float) -> None:
        basis = []
        for j in range(count):
            jacobi = [(-1) ** (j - k) * comb(j, k) * comb(j + k + 4, j) for k in range(j + 1)]
            basis.append(Polynomial([0.0, 0.0, *(np.sqrt(2.0 * j + 5.0) * np.array(jacobi))]))
        curvature = np.array([p.deriv(2)(_NODES) for p in basis])
        fourth_powers, combinations = np.linalg.eigh(curvature * _WEIGHTS @ curvature.T)  # of lambda L
        powers = np.zeros((count + 2, count))  # of xi, from the constant up; a column for each shape
        for j, p in enumerate(basis):
            powers[: len(p.coef)] += p.coef[:, None] * combinations[j]
        tips = 2.0 * scale * (-1.0) ** np.arange(count)  # as the cantilever's
        self._length = length
        self._coefficients: Array = powers * (tips / powers.sum(axis=0))
        self.wavenumbers = fourth_powers**0.25 / length

    def __call__(self, x: Array, order: int) -> Array:
        """Return the derivative of an order at the distances x [m]. Shape (..., m)."""
        derived = polynomial.polyder(self._coefficients, order) / self._length**order
        return np.moveaxis(polynomial.polyval(x / self._length, derived), 0, -1)


Shapes = CantileverShapes | PolynomialShapes
_SHAPES: dict[str, type[Shapes]] = {"cantilever": CantileverShapes, "polynomial": PolynomialShapes}


@lru_cache
def _evaluated(kind: str, length: float, count: int, scale: float) -> tuple[Shapes, Array, Array, Array, Array]:
    """Return shapes: themselves, they and their curvatures on the nodes, values and slopes at the tip."""
    shapes = _SHAPES[kind](length, count, scale)
    x, end = _NODES * length, np.array(length)
    return shapes, shapes(x, 0), shapes(x, 2), shapes(end, 0), shapes(end, 1)


@dataclass(frozen=True)
class LinkModes:
    """Modes and modal integrals of one bare link (no hub, no payload).

    Attributes:
        length: L [m].
        mass_per_length: rho [kg/m].
        shapes: phi_i and their derivatives.
        wavenumbers: lambda_i [1/m]. Shape (m,).
        frequencies: frequencies of the clamped-free link [rad/s] (5). Shape (m,).
        tip_values: phi_i(L) [m per unit modal coordinate]. Shape (m,).
        tip_slopes: phi_i'(L) [rad per unit modal coordinate]. Shape (m,).
        first_moment: integral of rho phi_i [kg m]. Shape (m,).
        second_moment: integral of rho x phi_i [kg m^2]. Shape (m,).
        mass: integral of rho phi_i phi_j [kg m^2]. Shape (m, m), diagonal to rounding error.
        stiffness: integral of EI phi_i'' phi_i'' [N m]. Shape (m,); the cross terms vanish.
    """

    length: float
    mass_per_length: float
    shapes: Shapes
    wavenumbers: Array
    frequencies: Array
    tip_values: Array
    tip_slopes: Array
    first_moment: Array
    second_moment: Array
    mass: Array
    stiffness: Array

    def shape(self, x: ArrayLike) -> Array:
        """Return phi_i at the distances x [m] (4). Shape (..., m)."""
        return self.shapes(np.asarray(x, dtype=float), 0)

    def slope(self, x: ArrayLike) -> Array:
        """Return phi_i' at the distances x [m]. Shape (..., m)."""
        return self.shapes(np.asarray(x, dtype=float), 1)

    def curvature(self, x: ArrayLike) -> Array:
        """Return phi_i'' at the distances x [m]. Shape (..., m)."""
        return self.shapes(np.asarray(x, dtype=float), 2)

    def foreshortening(self, x: ArrayLike) -> Array:
        """Return S_ij, integral of phi_i' phi_j' from the root to the distances x [m]. Shape (..., m, m)."""
        return _foreshortening(self.shapes, np.asarray(x, dtype=float))


def _foreshortening(shapes: Shapes, x: Array) -> Array:
    slopes = shapes(x[..., None] * _NODES, 1)
    return x[..., None, None] * np.einsum("n,...ni,...nj->...ij", _WEIGHTS, slopes, slopes)


@lru_cache
def _on_nodes(shapes: Shapes, length: float) -> tuple[Array, Array, Array]:
    """Return where a link's mass is taken to be, its tip the last, and S and phi there: they take most of the time."""
    x = np.append(_NODES, 1.0) * length
    return x, _foreshortening(shapes, x), shapes(x, 0)


@lru_cache(maxsize=256)
def link_modes(
    length: float,
    flexural_rigidity: float,
    mass_per_length: float,
    count: int,
    scale: float,
    mode_shapes: str = "cantilever",
) -> LinkModes:
    """Return the modes and integrals of a uniform link.

    Args:
        length: L [m].
        flexural_rigidity: EI [N m^2].
        mass_per_length: rho [kg/m].
        count: number of modes, m.
        scale: A (4) [m].
        mode_shapes: "cantilever" or "polynomial".

    Returns:
        `LinkModes`; the arguments are taken as validated (see `ArmParameters`).
    """
    shapes, phi, phi_xx, tips, slopes = _evaluated(mode_shapes, length, count, scale)
    x = _NODES * length
    weight = _WEIGHTS * length
    return LinkModes(
        length=length,
        mass_per_length=mass_per_length,
        shapes=shapes,
        wavenumbers=shapes.wavenumbers,
        frequencies=shapes.wavenumbers**2 * np.sqrt(flexural_rigidity / mass_per_length),  # (5)
        tip_values=tips,
        tip_slopes=slopes,
        first_moment=mass_per_length * weight @ phi,
        second_moment=mass_per_length * (weight * x) @ phi,
        mass=mass_per_length * phi.T @ (weight[:, None] * phi),
        stiffness=flexural_rigidity * weight @ phi_xx**2,
    )


@dataclass(frozen=True)
class ForeshorteningMoments:
    """Integrals of a link's foreshortening S over its mass and a point mass at its tip.

    Attributes:
        mean: integral of S [kg m]. Shape (m, m).
        shortened: integral of x S [kg m^2]. Shape (m, m).
        cubic: integral of phi_k S [kg m^2]. Shape (m, m, m).
        quartic: integral of S_ij S_kl [kg m^2], over pairs of modes i >= j, k >= l in lower-triangle order. Shape
            (p, p).
    """

    mean: Array
    shortened: Array
    cubic: Array
    quartic: Array


def foreshortening_moments(link: LinkModes, tip_mass: float) -> ForeshorteningMoments:
    """See `ForeshorteningMoments`; the tip mass is in kg."""
    x, s, phi = _on_nodes(link.shapes, link.length)
    mass = np.append(_WEIGHTS * link.length * link.mass_per_length, tip_mass)
    rows, columns = np.tril_indices(phi.shape[1])
    pairs = s[:, rows, columns]
    return ForeshorteningMoments(
        mean=np.tensordot(mass, s, 1),
        shortened=np.tensordot(mass * x, s, 1),
        cubic=np.tensordot((mass[:, None] * phi).T, s, 1),
        quartic=(mass[:, None] * pairs).T @ pairs,
    )
