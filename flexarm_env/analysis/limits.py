"""What a right-half-plane zero forbids to every controller of the plant.

With a zero z > 0 of output direction y, any loop that is internally stable keeps ``y^H S(z) = y^H``: at z, errors
along y cannot be reduced. Two consequences for the sensitivity S, both for its largest singular value, since errors
along y may become small while those of another output grow:

- If ``|S| <= |s / (s / M + omega_B)|``, which is M at high frequencies and falls below omega_B, then
  ``omega_B <= z (1 - 1/M)``; M = 2 gives the usual z / 2.
- If ``|S| <= epsilon`` up to omega_1, then somewhere ``|S| >= (1/epsilon)^(Theta / (pi - Theta))``,
  ``Theta = 2 arctan(omega_1 / z)``.

Neither needs more than that the plant has no pole right of the axis: a resting arm has its rigid-body poles at 0. They
hold for feedback; a path that is known in advance may be prepared for by feed-forward, some 1/z ahead.

Source: Skogestad & Postlethwaite, *Multivariable feedback control*, 2nd ed. (2005), ch. 5 and 6; Freudenberg & Looze,
IEEE Trans. Automatic Control 30 (1985).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flexarm_env.analysis.plant import Plant
from flexarm_env.analysis.zeros import SAME, zero_directions, zeros
from flexarm_env.validation import number

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class ZeroLimit:
    """One real right-half-plane zero and its limit.

    Attributes:
        zero: z [rad/s].
        multiplicity: algebraic.
        direction: output direction of length 1, real. Shape (outputs,).
        bandwidth: largest omega_B for the peak allowed [rad/s].
    """

    zero: float
    multiplicity: int
    direction: NDArray[np.float64]
    bandwidth: float


def zero_limits(plant: Plant, peak: float = 2.0) -> list[ZeroLimit]:
    """Return the limit of each real right-half-plane zero, slowest first.

    Args:
        plant: see `zeros`.
        peak: M, largest sensitivity allowed, > 1.
    """
    largest = number("peak", peak, above=1.0)
    limits = []
    for zero, multiplicity in zeros(plant).distinct():
        if zero.real > SAME * abs(zero) and zero.imag == 0.0:
            direction = zero_directions(plant, zero.real).output.real
            limits.append(ZeroLimit(zero.real, multiplicity, direction, zero.real * (1.0 - 1.0 / largest)))
    return limits


def sensitivity_peak(zero: float, bandwidth: float, tolerance: float) -> float:
    """Return the smallest possible peak of the sensitivity.

    Args:
        zero: z > 0 [rad/s].
        bandwidth: omega_1 up to which errors are reduced [rad/s].
        tolerance: epsilon to which they are reduced, > 0 and at most 1.
    """
    theta = 2.0 * np.arctan(
        number("bandwidth", bandwidth, "rad/s", above=0.0) / number("zero", zero, "rad/s", above=0.0)
    )
    epsilon = number("tolerance", tolerance, above=0.0, most=1.0)
    return float((1.0 / epsilon) ** (theta / (np.pi - theta)))
