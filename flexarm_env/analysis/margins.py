"""Gain and delay margins of the paper's loop, exact in the frequency domain.

`crossings` finds the delays and gains at which a root of the loop is on the imaginary axis; the first of them beyond a
stable loop is its margin.

Source: Gu, Kharitonov & Chen, *Stability of time-delay systems* (2003), ch. 4 (frequency sweeping).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from flexarm_env.analysis.crossings import GainCrossing, crossing_delays, crossing_gains
from flexarm_env.analysis.law_loop import LawLoop
from flexarm_env.parameters import MAX_DELAY
from flexarm_env.validation import instance

_LONGEST = (1e-3, 1e-2, 0.1, 1.0, MAX_DELAY)  # [s]; searched one after the other: the number of crossings grows with it


@dataclass(frozen=True)
class DelayMargin:
    """The smallest delay at which the loop is no longer stable.

    Attributes:
        delay: delay of the shoulder, the elbow's in proportion [s]; inf: stable up to the longest delay that a
            sensor may have, 10 s; 0: not stable even without delay, as with Kp = 0, which holds the arm nowhere.
        omega: frequency of the root that crosses there [rad/s]; nan where none does.
    """

    delay: float
    omega: float


@dataclass(frozen=True)
class GainMargin:
    """How far lambda may be changed, as factors.

    Attributes:
        stable: whether the loop is stable as it is (`is_stable`); if not, both factors are nan.
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


@dataclass(frozen=True)
class GainInterval:
    """Gains between which a loop is stable; lambda itself, not a factor.

    Attributes:
        low: 0, or the lambda at which a root crosses.
        high: the next, or inf.
    """

    low: float
    high: float


def delay_margin(loop: LawLoop) -> DelayMargin:
    """Find the smallest delay that destabilises the loop; only the ratio of the loop's own delays matters."""
    instance("loop", loop, LawLoop)
    if not any(np.any(term.P) for term in loop.terms) or np.any(loop.undelayed_poles().real >= 0.0):
        return DelayMargin(0.0, np.nan)
    for longest in _LONGEST:
        crossings = crossing_delays(loop, longest)
        if crossings:
            return DelayMargin(crossings[0].delay, crossings[0].omega)
    return DelayMargin(np.inf, np.nan)


def is_stable(loop: LawLoop) -> bool:
    """Return whether the loop is stable with its delay; a loop that needs a delay to be stable counts as unstable.

    Sufficient, and necessary up to stable islands at longer delays: `delay_roots` shows these.
    """
    instance("loop", loop, LawLoop)
    return loop.delay < delay_margin(loop).delay


def gain_margin(loop: LawLoop, known: DelayMargin | None = None) -> GainMargin:
    """Return how far lambda may grow and shrink at the loop's delay before a root crosses the axis.

    Args:
        loop: the loop.
        known: its `delay_margin`, if that has been computed.
    """
    instance("loop", loop, LawLoop)
    if loop.delay >= (delay_margin(loop) if known is None else known).delay:
        return GainMargin(False, np.nan, np.nan, np.nan, np.nan)
    crossings = crossing_gains(loop)
    up = next((c for c in crossings if c.factor > 1.0), GainCrossing(np.inf, np.nan))
    down = next((c for c in reversed(crossings) if c.factor < 1.0), GainCrossing(0.0, np.nan))
    return GainMargin(True, up.factor, down.factor, up.omega, down.omega)


def stable_gains(loop: LawLoop) -> list[GainInterval]:
    """Return the intervals of lambda in which the loop is stable at its delay (`is_stable`).

    Roots that cross to the right count +1, to the left -1; only the intervals with the smallest count can be stable,
    and one of them is checked for all.
    """
    crossings = crossing_gains(loop)
    counts = np.concatenate([[0], np.cumsum([_direction(loop, crossing) for crossing in crossings])])
    edges = [0.0, *(loop.gain * crossing.factor for crossing in crossings), np.inf]
    candidates = [
        GainInterval(low, high)
        for low, high, count in zip(edges[:-1], edges[1:], counts, strict=True)
        if count == counts.min() and high - low > 1e-9 * low
    ]
    if not candidates or not is_stable(loop.with_gain(_inside(candidates[0]))):
        return []
    return candidates


def _inside(interval: GainInterval) -> float:
    if not np.isfinite(interval.high):
        return 2.0 * interval.low if interval.low > 0.0 else 1.0
    return 0.5 * (interval.low + interval.high)


def _direction(loop: LawLoop, crossing: GainCrossing) -> int:
    """Return whether the root on the axis moves right (+1) or left (-1) as lambda grows."""
    at = np.array([crossing.omega])
    transfer, slope = crossing.factor * loop.loop_transfer(at)[0], crossing.factor * loop.loop_slope(at)[0]
    matrix = np.eye(2) + transfer
    adjugate = np.array([[matrix[1, 1], -matrix[0, 1]], [-matrix[1, 0], matrix[0, 0]]])
    moved = -np.trace(adjugate @ transfer) / np.trace(adjugate @ slope)
    return int(np.sign(moved.real))
