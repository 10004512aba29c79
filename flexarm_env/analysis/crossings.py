"""Delays and gains at which a root of the paper's loop is on the imaginary axis, exact in the frequency domain.

The characteristic function is ``det(1 + L(s))`` with ``L = L0 + z L1 + w L2``, ``z = exp(-s T)`` for the shoulder's
reading, ``w = exp(-s r T)`` for the elbow's. At s = j omega it is

- for one delay (r = 1) a quadratic in z: a root with |z| = 1 is a delay ``T = -arg z / omega``;
- for two delays a function of z and w: see `crossing_curves`;
- a quadratic in a factor on lambda: a root that is real and positive is a gain at which a root crosses.

So all crossings are found by following roots over omega: no Pade model, no truncation.

Source: Walton & Marshall, *Direct method for TDS stability analysis*, IEE Proc. D 134 (1987).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from flexarm_env.analysis.crossing_curves import TURN, curve_crossings
from flexarm_env.analysis.law_loop import LawLoop
from flexarm_env.analysis.sweep import bisected, determinant, frequencies, mixed
from flexarm_env.validation import instance, number

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]
Bools = NDArray[np.bool_]

SMALLEST_GAIN = 1e-9  # a root at a free arm's own frequency has lambda = 0 and is no crossing of a closed loop


@dataclass(frozen=True)
class DelayCrossing:
    """A delay at which a root of the loop is on the imaginary axis.

    Attributes:
        delay: T, of the shoulder's reading, the elbow's in proportion [s].
        omega: frequency of the root [rad/s].
    """

    delay: float
    omega: float


@dataclass(frozen=True)
class GainCrossing:
    """A gain at which a root of the loop is on the imaginary axis.

    Attributes:
        factor: on the loop's lambda, > 0.
        omega: frequency of the root [rad/s].
    """

    factor: float
    omega: float


def crossing_delays(loop: LawLoop, longest: float = 0.2) -> list[DelayCrossing]:
    """Find every delay up to a longest at which a root is on the imaginary axis, sorted by delay.

    Args:
        loop: the loop; its own delay plays no part, the ratio of its delays does.
        longest: [s]. The number of crossings grows with it: each comes again after 2 pi / omega.
    """
    instance("loop", loop, LawLoop)
    number("longest", longest, "s", above=0.0)
    delays, omega = (_of_one_delay if loop.ratio == 1.0 else curve_crossings)(loop, longest)
    kept = (delays >= 0.0) & (delays <= longest)
    pairs = sorted(zip(delays[kept].tolist(), omega[kept].tolist(), strict=True))
    return [DelayCrossing(delay, w) for delay, w in pairs]


def crossing_gains(loop: LawLoop) -> list[GainCrossing]:
    """Find every factor on lambda at which a root is on the imaginary axis at the loop's delay, sorted by factor."""
    instance("loop", loop, LawLoop)
    omega = frequencies(loop)
    roots = _paired(_gain_roots(loop, omega))
    turns = roots.imag[:-1] * roots.imag[1:] < 0.0
    ahead = (roots.real[:-1] > 0.0) | (roots.real[1:] > 0.0)
    found = []
    for index, branch in zip(*np.nonzero(turns & ahead), strict=True):
        start = roots[index, branch]

        def nearest(at: float, start: complex = start) -> complex:
            candidates = _gain_roots(loop, np.array([at]))[0]
            return complex(candidates[np.argmin(np.abs(candidates - start))])

        low, high = omega[index : index + 2].tolist()
        try:
            w = float(brentq(lambda at, root=nearest: root(at).imag, low, high, xtol=1e-14 * high, rtol=1e-14))
            factor = nearest(w)
        except (ValueError, np.linalg.LinAlgError):  # no change of sign, or a pole of an undamped arm: lambda is 0
            continue
        if factor.real > SMALLEST_GAIN and abs(factor.imag) < 1e-6 * factor.real:  # else it jumps
            found.append(GainCrossing(factor.real, w))
    return sorted(found, key=lambda crossing: crossing.factor)


def _of_one_delay(loop: LawLoop, longest: float) -> tuple[Array, Array]:
    """Return the delays and frequencies of the crossings, unsorted. Shape (k,) each."""
    omega = frequencies(loop)
    sizes = np.abs(_late_roots(loop, omega)) - 1.0
    index, branch = np.nonzero(sizes[:-1] * sizes[1:] < 0.0)
    below = sizes[index, branch] < 0.0
    own = np.arange(len(index))

    def before(middle: Array) -> Bools:
        return np.asarray((np.abs(_late_roots(loop, middle)[own, branch]) < 1.0) == below)

    at = bisected(before, omega[index], omega[index + 1])
    roots = _late_roots(loop, at)[own, branch]
    true = np.abs(np.abs(roots) - 1.0) < 1e-6  # a jump, at a pole of the free arm, is none
    at, delays = at[true], (-np.angle(roots[true]) % TURN) / at[true]
    if not len(at):
        return at, at
    turns = TURN * np.arange(int(longest * at.max() / TURN) + 1)
    return (delays + np.divide.outer(turns, at)).ravel(), np.tile(at, len(turns))


def _late_roots(loop: LawLoop, omega: Array) -> Complex:
    """Return the roots z of det(1 + L0 + z (L1 + L2)), by size. Shape (k, 2)."""
    terms = loop.loop_terms(omega)
    now, late = np.eye(2) + terms[:, 0], terms[:, 1] + terms[:, 2]
    roots = _roots(determinant(late), mixed(now, late), determinant(now))
    return np.take_along_axis(roots, np.argsort(np.abs(roots), axis=1), axis=1)


def _gain_roots(loop: LawLoop, omega: Array) -> Complex:
    """Return the roots g of det(1 + g L). Shape (k, 2)."""
    matrices = loop.loop_transfer(omega)
    trace = matrices[:, 0, 0] + matrices[:, 1, 1]
    return _roots(determinant(matrices), trace, np.ones_like(trace))


def _roots(a: Complex, b: Complex, c: Complex) -> Complex:
    """Return the roots of a x^2 + b x + c, c not 0; infinity where a is 0. Shape (k, 2)."""
    root = np.sqrt(b**2 - 4.0 * a * c)
    half = -0.5 * (b + np.where((b.conj() * root).real < 0.0, -root, root))  # without cancellation
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.stack([c / half, np.where(a == 0.0, np.inf, half / a)], axis=1)


def _paired(roots: Complex) -> Complex:
    """Return two roots at each frequency, in the order that changes least from one to the next."""
    ordered = roots.copy()
    for i in range(1, len(ordered)):
        before, now = ordered[i - 1], ordered[i]
        with np.errstate(invalid="ignore"):
            straight = np.abs(now - before).sum()
            crossed = np.abs(now[::-1] - before).sum()
        if crossed < straight:
            ordered[i] = now[::-1]
    return ordered
