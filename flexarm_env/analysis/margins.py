"""Gain and delay margins of the paper's loop, exact in the frequency domain.

The characteristic function is ``det(1 + L(s))`` with ``L = sum_k lambda z^(n_k) (P_k + s V_k) Q(s)``. The delays are
whole multiples of one, so that ``z = exp(-s T / d)``. On the imaginary axis, s = j omega, the determinant is

- a polynomial in z: a root with |z| = 1 is a delay ``T = d (-arg z) / omega`` at which a root of the loop crosses;
- a polynomial in lambda: a root that is real and positive is a gain at which one crosses.

So all crossings are found by following polynomial roots over omega: no Pade model, no truncation.

Source: Walton & Marshall, *Direct method for TDS stability analysis*, IEE Proc. D 134 (1987); Gu, Kharitonov & Chen,
*Stability of time-delay systems* (2003), ch. 4 (frequency sweeping).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from flexarm_env.analysis.law_loop import LawLoop
from flexarm_env.analysis.natural import natural_modes

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

# The grid of frequencies: from far below the loop's slowest motion, near 1 rad/s, to far beyond its fastest pole.
LOWEST, BEYOND, PER_DECADE = 1e-2, 30.0, 100
BISECTIONS = 52  # to the last bit
SMALLEST_GAIN = 1e-9  # a root at a free arm's own frequency has lambda = 0 and is no crossing of a closed loop


@dataclass(frozen=True)
class DelayMargin:
    """The smallest delay at which the loop is no longer stable.

    Attributes:
        delay: of the shoulder's reading, the elbow's in proportion [s]; inf: stable for every delay; 0: not stable even
            without delay.
        omega: frequency of the root that crosses there [rad/s]; nan where none does.
    """

    delay: float
    omega: float


@dataclass(frozen=True)
class GainMargin:
    """How far lambda may be changed, as factors.

    Attributes:
        stable: whether the loop is stable as it is; if not, both factors are nan.
        up: the smallest factor >= 1 that makes it unstable; inf: none does.
        down: the largest factor <= 1 that makes it unstable; 0: none does.
        omega_up: frequency at which a root crosses there [rad/s]; nan where none does.
        omega_down: the same for `down`.
    """

    stable: bool
    up: float
    down: float
    omega_up: float
    omega_down: float


def crossing_delays(loop: LawLoop) -> list[DelayMargin]:
    """Delays at which a root is on the imaginary axis, each the smallest of its frequency, by delay.

    Args:
        loop: the loop; its own delay plays no part.
    """
    omega = _frequencies(loop)
    sizes = np.abs(_by_size(_delay_roots(loop, omega))) - 1.0
    index, branch = np.nonzero(sizes[:-1] * sizes[1:] < 0.0)
    if not len(index):
        return []
    low, high, below = omega[index], omega[index + 1], sizes[index, branch] < 0.0
    for _ in range(BISECTIONS):  # all crossings at once: the roots come in batches
        middle = 0.5 * (low + high)
        left = (np.abs(_own(loop, middle, branch)) < 1.0) == below
        low, high = np.where(left, middle, low), np.where(left, high, middle)
    roots = _own(loop, low, branch)
    delays = loop.ratio.denominator * (-np.angle(roots) % (2.0 * np.pi)) / low
    true = np.abs(np.abs(roots) - 1.0) < 1e-6  # a jump, at a pole of the free arm, is none
    found = [DelayMargin(float(delay), float(w)) for delay, w in zip(delays[true], low[true], strict=True)]
    return sorted(found, key=lambda crossing: crossing.delay)


def delay_margin(loop: LawLoop) -> DelayMargin:
    """The smallest delay that destabilises the loop; its own delay plays no part."""
    if np.any(loop.undelayed_poles().real >= 0.0):
        return DelayMargin(0.0, np.nan)
    crossings = crossing_delays(loop)
    return crossings[0] if crossings else DelayMargin(np.inf, np.nan)


def is_stable(loop: LawLoop) -> bool:
    """Whether the loop is stable with its delay; a loop that needs a delay to be stable counts as unstable.

    Sufficient, and necessary up to stable islands at longer delays.
    """
    return loop.delay < delay_margin(loop).delay


def crossing_gains(loop: LawLoop) -> list[tuple[float, float]]:
    """Every (factor on lambda, frequency) at which a root is on the imaginary axis, by factor."""
    omega = _frequencies(loop)
    roots = _paired(_gain_roots(loop, omega))
    turns = roots.imag[:-1] * roots.imag[1:] < 0.0
    ahead = (roots.real[:-1] > 0.0) | (roots.real[1:] > 0.0)
    found = []
    for index, branch in zip(*np.nonzero(turns & ahead), strict=True):
        start = roots[index, branch]

        def imaginary(w: float, start: complex = start) -> float:
            candidates = _gain_roots(loop, np.array([w]))[0]
            return float(candidates[np.argmin(np.abs(candidates - start))].imag)

        w = _crossing(imaginary, omega[index], omega[index + 1])
        if w is None:
            continue
        candidates = _gain_roots(loop, np.array([w]))[0]
        factor = candidates[np.argmin(np.abs(candidates - start))]
        if factor.real > SMALLEST_GAIN and abs(factor.imag) < 1e-6 * factor.real:
            found.append((float(factor.real), w))
    return sorted(found)


def gain_margin(loop: LawLoop, known: DelayMargin | None = None) -> GainMargin:
    """How far lambda may grow and shrink at the loop's delay before a root crosses the axis.

    Args:
        loop: the loop.
        known: its `delay_margin`, if that has been computed.
    """
    if loop.delay >= (delay_margin(loop) if known is None else known).delay:
        return GainMargin(False, np.nan, np.nan, np.nan, np.nan)
    crossings = crossing_gains(loop)
    up = next(((factor, w) for factor, w in crossings if factor > 1.0), (np.inf, np.nan))
    down = next(((factor, w) for factor, w in reversed(crossings) if factor < 1.0), (0.0, np.nan))
    return GainMargin(True, up[0], down[0], up[1], down[1])


def stable_gains(loop: LawLoop) -> list[tuple[float, float]]:
    """Intervals of lambda, not factors, in which the loop is stable at its delay.

    Roots that cross to the right count +1, to the left -1; only the intervals with the smallest count can be stable,
    and one of them speaks for all.
    """
    crossings = crossing_gains(loop)
    counts = np.concatenate([[0], np.cumsum([_direction(loop, factor, omega) for factor, omega in crossings])])
    edges = [0.0, *(loop.gain * factor for factor, _ in crossings), np.inf]
    candidates = [
        (low, high)
        for low, high, count in zip(edges[:-1], edges[1:], counts, strict=True)
        if count == counts.min() and high - low > 1e-9 * low
    ]
    if not candidates or not is_stable(loop.with_gain(_between(*candidates[0]))):
        return []
    return candidates


def _between(low: float, high: float) -> float:
    """A gain inside an interval."""
    if not np.isfinite(high):
        return 2.0 * low if low > 0.0 else 1.0
    return 0.5 * (low + high)


def _direction(loop: LawLoop, factor: float, omega: float) -> int:
    """Whether the root on the axis moves right (+1) or left (-1) as lambda grows."""
    at = np.array([omega])
    transfer, slope = factor * loop.loop_transfer(at)[0], factor * loop.loop_slope(at)[0]
    matrix = np.eye(2) + transfer
    adjugate = np.array([[matrix[1, 1], -matrix[0, 1]], [-matrix[1, 0], matrix[0, 0]]])
    moved = -np.trace(adjugate @ transfer) / np.trace(adjugate @ slope)
    return int(np.sign(moved.real))


def _delay_roots(loop: LawLoop, omega: Array) -> Complex:
    """Roots z of det(1 + L), as a polynomial in z. Shape (k, degree)."""
    terms = loop.loop_terms(omega)
    now, shoulder, elbow = np.eye(2) + terms[:, 0], terms[:, 1], terms[:, 2]
    first, second = loop.ratio.denominator, loop.ratio.numerator
    parts = [(0, _determinant(now)), (first, _mixed(now, shoulder)), (second, _mixed(now, elbow))]
    if np.any(loop.elbow.P):  # each joint's term then has rank one: no squares
        parts.append((first + second, _mixed(shoulder, elbow)))
    else:
        parts.append((2 * first, _determinant(shoulder)))
    coefficients = np.zeros((len(omega), parts[-1][0] + 1), dtype=complex)
    for power, values in parts:
        coefficients[:, power] += values
    return _roots(coefficients)


def _by_size(roots: Complex) -> Complex:
    return np.take_along_axis(roots, np.argsort(np.abs(roots), axis=1), axis=1)


def _own(loop: LawLoop, omega: Array, branch: NDArray[np.int64]) -> Complex:
    """At each frequency the root that is the branch-th by size. Shape (k,)."""
    return np.asarray(_by_size(_delay_roots(loop, omega))[np.arange(len(omega)), branch])


def _gain_roots(loop: LawLoop, omega: Array) -> Complex:
    """Roots g of det(1 + g L). Shape (k, 2)."""
    matrices = loop.loop_transfer(omega)
    trace = matrices[:, 0, 0] + matrices[:, 1, 1]
    return _roots(np.stack([np.ones_like(trace), trace, _determinant(matrices)], axis=1))


def _determinant(matrices: Complex) -> Complex:
    return np.asarray(matrices[..., 0, 0] * matrices[..., 1, 1] - matrices[..., 0, 1] * matrices[..., 1, 0])


def _mixed(a: Complex, b: Complex) -> Complex:
    """What det(a + b) has beyond det(a) + det(b)."""
    return np.asarray(
        a[..., 0, 0] * b[..., 1, 1]
        + a[..., 1, 1] * b[..., 0, 0]
        - a[..., 0, 1] * b[..., 1, 0]
        - a[..., 1, 0] * b[..., 0, 1]
    )


def _roots(coefficients: Complex) -> Complex:
    """Roots of many polynomials, as reciprocals of the eigenvalues of the reversed ones' companion matrices.

    Args:
        coefficients: lowest power first, which is not 0. Shape (k, degree + 1).

    Returns:
        Shape (k, degree); a degree that is not there gives a root at infinity.
    """
    count, degree = coefficients.shape[0], coefficients.shape[1] - 1
    companion = np.zeros((count, degree, degree), dtype=complex)
    companion[:, 0] = -coefficients[:, 1:] / coefficients[:, :1]
    companion[:, 1:, :-1] = np.eye(degree - 1)
    reciprocals = np.linalg.eigvals(companion)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(reciprocals == 0.0, np.inf, 1.0 / reciprocals)


def _frequencies(loop: LawLoop) -> Array:
    """A grid over all of the loop's frequencies, dense about the arm's own, free and locked."""
    near = np.concatenate([-np.geomspace(0.05, 1e-6, 30), np.geomspace(1e-6, 0.05, 30)])
    own = np.concatenate([natural_modes(loop.point, joints).frequencies for joints in ("free", "locked")])
    own = own[own > 0.0]
    highest = BEYOND * max(float(np.abs(loop.undelayed_poles()).max()), float(own.max()))
    grid = np.geomspace(LOWEST, highest, int(PER_DECADE * np.log10(highest / LOWEST)))
    return np.unique(np.concatenate([grid, np.outer(own, 1.0 + near).ravel()]))


def _paired(roots: Complex) -> Complex:
    """Two roots at each frequency, in the order that changes least from one to the next."""
    ordered = roots.copy()
    for i in range(1, len(ordered)):
        before, now = ordered[i - 1], ordered[i]
        with np.errstate(invalid="ignore"):
            straight = np.abs(now - before).sum()
            crossed = np.abs(now[::-1] - before).sum()
        if crossed < straight:
            ordered[i] = now[::-1]
    return ordered


def _crossing(function: Callable[[float], float], low: float, high: float) -> float | None:
    """Where a function changes sign; None if it does not, or jumps."""
    ends = function(low), function(high)
    if not np.all(np.isfinite(ends)) or ends[0] * ends[1] >= 0.0:
        return None
    try:
        root = float(brentq(function, low, high, xtol=1e-14 * high, rtol=1e-14))
        value = function(root)
    except np.linalg.LinAlgError:  # it shrinks onto a pole of an undamped arm, where lambda is 0
        return None
    return root if abs(value) < 1e-6 * max(1.0, abs(ends[0]), abs(ends[1])) else None
