"""Exact zeros of one link: the Euler-Bernoulli beam itself, which no number of modes truncates.

A uniform link, hinged at its root with a torque there and free at its tip. Where the deflection plus root rotation of
the point s, its position, stays zero under a vibration exp(sigma t), sigma is a zero of torque -> position of s:

    EI w'''' + rho sigma^2 w = 0,  w(0) = 0,  w''(L) = w'''(L) = 0,  w(s) = 0.

For sigma real, with ``kappa = (rho sigma^2 / 4 EI)^(1/4)``, w is made of exp(-kappa x) and exp(-kappa (L - x)), each
times cos and sin; for sigma = j omega, with ``k = (rho omega^2 / EI)^(1/4)``, of cos kx, sin kx, exp(-kx) and
exp(-k (L - x)). Written so, every factor is of the order of 1 and nothing cancels, however short the waves. At the tip
the condition is tan(kappa L) + tanh(kappa L) = 0, whose first root 2.3650 is that of a free-free beam's symmetric mode
at half length.

For short waves the n-th roots tend to kappa s = n pi, at the tip to kappa L = (n - 1/4) pi; on the axis to
k (L - s) = (n - 3/4) pi.

Source: Spector & Flashner, *Modeling and design implications of noncollocated control in flexible systems*, ASME J.
Dyn. Syst. Meas. Control 112 (1990), who find these zeros for the pinned-free beam.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import instance, integer, number

Array = NDArray[np.float64]
_POINTS_PER_UNIT = 40  # of kappa L and k L in the search for sign changes; roots are about pi or more apart
# kappa L and k L up to which is searched: a wave is then 2 pi / 1000 of the link long, far too short for a slender beam
_LARGEST = 1000.0


@dataclass(frozen=True, eq=False)
class LinkZeros:
    """Zeros of one exact link, root torque -> position of a point.

    Attributes:
        real: sigma > 0 [rad/s], smallest first; -sigma is a zero as well. Shape (k,).
        imaginary: omega > 0 of the zeros +-j omega [rad/s], smallest first. Shape (l,).
    """

    real: Array
    imaginary: Array


def link_zeros(arm: FlexibleArm, link: int, position: float, count: int = 3) -> LinkZeros:
    """Return the first zeros of root torque -> transverse position of a point, of the exact beam.

    Args:
        arm: its uniform link, hinged; lumped masses play no part.
        link: 1 or 2.
        position: s, distance of the point from the root [m], > 0.
        count: how many real and how many imaginary ones, 1 to 20. There are fewer where the next has kappa L or k L
            above 1000: real ones of a point nearer to the root than about ``count L / 300``, imaginary ones of a
            point as near to the tip, and at the tip itself there are no imaginary ones.
    """
    instance("arm", arm, FlexibleArm)
    integer("link", link, 1, 2)
    integer("count", count, 1, 20)
    p = arm.parameters
    length = p.link_lengths[link - 1]
    share = number("position", position, "m", above=0.0, most=length) / length
    speed = np.sqrt(p.flexural_rigidities[link - 1] / p.masses_per_length[link - 1]) / length**2
    real = _roots(lambda z: _decaying(z, share), count)
    imaginary = _roots(lambda z: _swinging(z, share), count)
    return LinkZeros(2.0 * speed * real**2, speed * imaginary**2)


def _decaying(z: Array, share: float) -> Array:
    """Return w(s) for a real sigma, up to a positive factor; `z`: kappa L, Shape (k,), `share`: s / L.

    ``w = (a cos + b sin)(kappa x) exp(-kappa x) + (c cos + d sin)(kappa (L - x)) exp(-kappa (2 L - x))``: the free end
    gives c and d from a and b, the hinge a from b.
    """
    cos, sin, echo = np.cos(z), np.sin(z), np.exp(-2.0 * z)
    c_of_a, d_of_a = cos - 2.0 * sin, sin
    c_of_b, d_of_b = 2.0 * cos + sin, -cos
    a = -echo * (c_of_b * cos + d_of_b * sin)
    b = 1.0 + echo * (c_of_a * cos + d_of_a * sin)
    c, d = c_of_a * a + c_of_b * b, d_of_a * a + d_of_b * b
    near, far = z * share, z * (1.0 - share)
    return np.asarray(a * np.cos(near) + b * np.sin(near) + np.exp(-2.0 * far) * (c * np.cos(far) + d * np.sin(far)))


def _swinging(z: Array, share: float) -> Array:
    """Return w(s) for an imaginary sigma, up to a positive factor; `z`: k L, Shape (k,), `share`: s / L.

    ``w = a cos kx + b sin kx + c exp(-kx) + d exp(-k (L - x))`` with ``a = -c - d exp(-kL)`` (hinge); the free end's
    two conditions leave (b, c, d) as their vector product.
    """
    cos, sin, echo = np.cos(z), np.sin(z), np.exp(-z)
    moment = -sin, cos + echo, 1.0 + echo * cos
    shear = -cos, -sin - echo, 1.0 - echo * sin
    b = moment[1] * shear[2] - moment[2] * shear[1]
    c = moment[2] * shear[0] - moment[0] * shear[2]
    d = moment[0] * shear[1] - moment[1] * shear[0]
    near, far = z * share, z * (1.0 - share)
    return np.asarray(-(c + d * echo) * np.cos(near) + b * np.sin(near) + c * np.exp(-near) + d * np.exp(-far))


def _roots(function: Callable[[Array], Array], count: int) -> Array:
    """Return the first roots from 0.3 to `_LARGEST`, by sign changes."""
    z = np.arange(0.3, _LARGEST, 1.0 / _POINTS_PER_UNIT)
    values = function(z)
    turns = np.nonzero(values[:-1] * values[1:] < 0.0)[0][:count]

    def one(at: float) -> float:
        return float(function(np.array([at]))[0])

    return np.array([brentq(one, z[i], z[i + 1], xtol=1e-13) for i in turns])
