"""Crossings of a loop whose two joints are late by different delays, of any ratio.

Each joint's term has rank one, so that with ``z = exp(-s T)`` for the longer delay and ``w = exp(-s share T)`` for the
shorter one the characteristic function is ``D0 + D1 z + (D2 + D12 z) w``. It vanishes with |z| = |w| = 1 only where
``|D0 + D1 z| = |D2 + D12 z|``, which is an equation for the cosine of one angle: two z at most at each frequency. These
are the loop's crossing curves, pairs of phases; a crossing is where the phase of w is `share` times that of z, up to
whole turns. The delays need not be multiples of one.

Near a frequency at which the undelayed loop is hardly damped the phases turn within a part in a million: the grid is
halved there until they do so in steps.

Source: Gu, Niculescu & Chen, *On stability crossing curves for general systems with two delays*, J. Math. Anal. Appl.
311 (2005).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.analysis.law_loop import LawLoop
from flexarm_env.analysis.sweep import bisected, determinant, frequencies, mixed

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

TURN = 2.0 * np.pi
_THIRDS = 45  # steps of the ternary search for a minimum: it ends at the root of the rounding error
_COARSE, _HALVINGS = 0.25, 40  # [rad] or the cosine of one; halvings of the grid's interval
# Where a pair of crossing curves ends, its phases turn with the root of the distance: points by powers of that.
_NEAR_END = np.geomspace(1e-12, 1.0, 40)[:-1]


class _Cells(NamedTuple):
    """Pieces of crossing curves that hold a crossing, from one frequency of the grid to the next.

    Attributes:
        low: lower frequency [rad/s]. Shape (k,).
        high: upper frequency [rad/s]. Shape (k,).
        branch: which of the two curves. Shape (k,).
        phases: phases of the longer and the shorter delay at the lower frequency, with whole turns [rad]. Shape (k, 2).
        wanted: multiple of 2 pi that `_excess` passes [rad]. Shape (k,).
    """

    low: Array
    high: Array
    branch: NDArray[np.int64]
    phases: Array
    wanted: Array


def curve_crossings(loop: LawLoop, longest: float) -> tuple[Array, Array]:
    """Find the crossings of a loop with two delays, unsorted.

    Args:
        loop: its ratio is not 1.
        longest: largest value of the shoulder's delay [s].

    Returns:
        The shoulder's delays [s], some of them negative or above the longest, and frequencies [rad/s]. Shape (k,) each.
    """
    cells = _cells(loop, longest * max(loop.ratio, 1.0))
    rising = _excess(loop, cells, cells.low)[0] < 0.0
    at = bisected(lambda middle: (_excess(loop, cells, middle)[0] < 0.0) == rising, cells.low, cells.high)
    excess, phase = _excess(loop, cells, at)
    true = np.abs(excess) < 1e-6
    return phase[true] / at[true] / max(loop.ratio, 1.0), at[true]


def _cells(loop: LawLoop, longest: float) -> _Cells:
    """Find where the shorter delay's phase passes `_share` times the longer one's, up to the delay `longest` [s]."""
    omega = _curve_points(loop)
    phases = _phases(loop, omega)
    steps = _wrapped(np.diff(phases, axis=0))
    there = np.isfinite(steps).all(axis=2)
    weight = np.array([_share(loop), 1.0])
    found = []
    for turn in range(-1, int(longest * omega[-1] / TURN) + 2):
        own = phases[:-1] + np.array([TURN * turn, 0.0])
        soon = there & (own[:, :, 0] <= longest * omega[1:, None] + np.pi)
        if not soon.any():
            break
        counts = np.floor(np.stack([own @ weight, (own + steps) @ weight])[:, soon] / TURN)
        passed = counts[0] != counts[1]
        index, branch = (part[passed] for part in np.nonzero(soon))
        found.append((index, branch, own[index, branch], TURN * counts.max(axis=0)[passed]))
    if not found:  # nothing is late
        return _Cells(np.zeros(0), np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros(0))
    index, branch, starts, wanted = (np.concatenate(part) for part in zip(*found, strict=True))
    return _Cells(omega[index], omega[index + 1], branch, starts, wanted)


def _excess(loop: LawLoop, cells: _Cells, omega: Array) -> tuple[Array, Array]:
    """Return by how much each cell's phase is beyond a crossing's, and the longer delay's phase [rad]. Shape (k,) each.

    `omega`: a frequency in each cell [rad/s]. Shape (k,).
    """
    now = _phases(loop, omega)[np.arange(len(omega)), cells.branch]
    now = cells.phases + _wrapped(now - cells.phases)
    return now @ np.array([_share(loop), 1.0]) - cells.wanted, now[:, 0]


def _share(loop: LawLoop) -> float:
    """Return the shorter of the two delays over the longer."""
    return min(loop.ratio, 1.0 / max(loop.ratio, 1.0))


def _phases(loop: LawLoop, omega: Array) -> Array:
    """Return both crossing curves: the longer delay's phase ``omega T`` and the angle of the shorter one's number.

    Returns:
        [rad]; nan where there is none. Shape (k, 2 curves, 2).
    """
    d0, d1, d2, d12 = _coefficients(loop, omega)
    centre, cosine = _opening(loop, omega)
    with np.errstate(divide="ignore", invalid="ignore"):
        phase = (centre + np.arccos(cosine) * np.array([[1.0], [-1.0]])).T % TURN
        z = np.exp(-1j * phase)
        other = np.angle(-(d0[:, None] + d1[:, None] * z) / (d2[:, None] + d12[:, None] * z))
    return np.stack([phase, other], axis=2)


def _opening(loop: LawLoop, omega: Array) -> tuple[Array, Array]:
    """Return the mean of both curves' phases [rad] and the cosine of half their distance; none where it exceeds 1.

    ``|D0 + D1 z|^2 = |D2 + D12 z|^2`` is ``Re(q z) = c / 2``, with ``z = exp(-j phase)``.
    """
    d0, d1, d2, d12 = _coefficients(loop, omega)
    q = d0.conj() * d1 - d2.conj() * d12
    c = np.abs(d2) ** 2 + np.abs(d12) ** 2 - np.abs(d0) ** 2 - np.abs(d1) ** 2
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.angle(q), c / (2.0 * np.abs(q))


def _beyond(loop: LawLoop, omega: Array) -> Array:
    """Return by how much the cosine's magnitude exceeds 1; there are curves where it does not. Shape (k,)."""
    return np.asarray(np.abs(_opening(loop, omega)[1]) - 1.0)


def _coefficients(loop: LawLoop, omega: Array) -> tuple[Complex, Complex, Complex, Complex]:
    """Return D0, D1 (of the longer delay), D2, D12. Shape (k,) each."""
    terms = loop.loop_terms(omega)
    now, late, soon = np.eye(2) + terms[:, 0], terms[:, 1], terms[:, 2]
    if loop.ratio > 1.0:
        late, soon = soon, late
    return determinant(now), mixed(now, late), mixed(now, soon), mixed(late, soon)


def _curve_points(loop: LawLoop) -> Array:
    """Return the frequencies that separate both curves, and the gaps between their pieces [rad/s]. Shape (k,)."""

    def shape(at: Array) -> Array:
        cosine = np.clip(_opening(loop, at)[1], -2.0, 2.0)
        return np.concatenate([cosine[:, None], _phases(loop, at).reshape(len(at), 4)], axis=1)

    omega = _refined(shape, frequencies(loop))
    omega = np.unique(np.concatenate([omega, _turning(loop, omega)]))
    has = _beyond(loop, omega) <= 0.0
    index = np.nonzero(has[:-1] != has[1:])[0]
    low, high = omega[index], omega[index + 1]
    end = bisected(lambda middle: (_beyond(loop, middle) <= 0.0) == has[index], low, high)
    ends = (end + np.outer(_NEAR_END, side - end) for side in (low, high))
    return _refined(shape, np.unique(np.concatenate([omega, *ends], axis=None)))


def _refined(shape: Callable[[Array], Array], omega: Array) -> Array:
    """Halve the grid where a curve's values change by more than `_COARSE`: a root near the axis turns them quickly.

    Args:
        shape: function of frequencies: angles and numbers, nan where there is none. Shape (k, values).
        omega: Shape (k,).
    """
    values = shape(omega)
    for _ in range(_HALVINGS):
        steps = np.nan_to_num(np.abs(_wrapped(np.diff(values, axis=0)))).max(axis=1)
        wide = (steps > _COARSE) & (np.diff(omega) > 1e-13 * omega[1:])
        if not wide.any():
            break
        middle = 0.5 * (omega[:-1] + omega[1:])[wide]
        omega, values = np.append(omega, middle), np.concatenate([values, shape(middle)])
        order = np.argsort(omega)
        omega, values = omega[order], values[order]
    return omega


def _turning(loop: LawLoop, omega: Array) -> Array:
    """Return where the cosine turns between points of the grid: there a pair of curves, or a gap in one, may hide."""
    value = _beyond(loop, omega)
    sign = np.sign(value[1:-1])  # outside a pair a minimum is looked for, inside a maximum
    least = (sign * value[1:-1] <= sign * value[:-2]) & (sign * value[1:-1] <= sign * value[2:])
    index = np.nonzero(least)[0] + 1
    sign, low, high = sign[index - 1], omega[index - 1], omega[index + 1]
    for _ in range(_THIRDS):
        one, two = low + (high - low) / 3.0, high - (high - low) / 3.0
        first = sign * _beyond(loop, one) < sign * _beyond(loop, two)
        low, high = np.where(first, low, one), np.where(first, two, high)
    return 0.5 * (low + high)


def _wrapped(angle: Array) -> Array:
    """Wrap an angle to -pi ... pi."""
    return np.asarray((angle + np.pi) % TURN - np.pi)
