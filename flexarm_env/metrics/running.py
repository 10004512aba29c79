"""The figures of runs that go on, gathered without keeping the runs; the only formulas of `LapFigures`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.laps import SETTLED
from flexarm_env.metrics.corners import Corner
from flexarm_env.metrics.figures import CornerFigures, LapFigures
from flexarm_env.validation import finite_values, integer, number, shown

Array = NDArray[np.float64]

BAND = 0.05  # [m]; the tip has settled once its distance from the reference stays below
AT_LIMIT = 1.0 - 1e-6  # share of the torque limit from which a torque counts as limited: float32 actions round
EDGE = 1e-9  # [s]; rounding of instants


class Instants(NamedTuple):
    """What the figures are made of, at k instants of n runs.

    Attributes:
        time: [s]. Shape (k,).
        tip: true tip [m]. Shape (k, n, 2).
        reference: [m]. Shape (k, n, 2).
        direction: unit vector of the reference's travel. Shape (k, n, 2).
        deflection: deflection of the links' tips [m]. Shape (k, n, 2).
        deflection_rate: [m/s]. Shape (k, n, 2).
        joints: theta1, theta2 [rad]. Shape (k, n, 2).
        torque: that acts from this instant on; not read at the last instant of a run [N m]. Shape (k, n, 2).
    """

    time: Array
    tip: Array
    reference: Array
    direction: Array
    deflection: Array
    deflection_rate: Array
    joints: Array
    torque: Array


def contour_and_lag(tip: Array, reference: Array, direction: Array) -> tuple[Array, Array]:
    """Split the tip's error across and along the reference's direction of travel.

    Args:
        tip: Shape (..., 2) [m].
        reference: Shape (..., 2) [m].
        direction: unit vectors. Shape (..., 2).

    Returns:
        The contour error, positive left of the direction of travel, and the lag error, positive behind the
        reference [m]. Their squares add up to the squared distance. Shape (...) each.
    """
    error = tip - reference
    contour = direction[..., 0] * error[..., 1] - direction[..., 1] * error[..., 0]
    return contour, -np.sum(direction * error, axis=-1)


class _Moments:
    """Count, sum, sum of squares and largest magnitude of values that arrive over time."""

    def __init__(self, *shape: int) -> None:
        self.count = 0
        self.total, self.squares, self.largest = np.zeros(shape), np.zeros(shape), np.zeros(shape)

    def add(self, values: Array) -> None:
        """Take more values. Shape (k, *shape)."""
        if len(values):
            self.count += len(values)
            self.total += values.sum(axis=0)
            self.squares += (values**2).sum(axis=0)
            self.largest = np.maximum(self.largest, np.abs(values).max(axis=0))

    @property
    def rms(self) -> Array:
        """Return the root of the mean square so far; 0 of no values. Shape as given."""
        return np.sqrt(self.squares / max(self.count, 1))

    @property
    def mean(self) -> Array:
        """Return the mean so far; 0 of no values. Shape as given."""
        return self.total / max(self.count, 1)


class _CornerWatch:
    """What happens in n runs from one corner until the next."""

    def __init__(self, corner: Corner, runs: int, band: float) -> None:
        self.corner, self.band = corner, band
        self.advance = np.full(runs, -np.inf)
        self.outside = np.ones(runs, dtype=bool)  # at the newest instant
        self.settled_at = np.full(runs, np.nan)
        self.rates = _Moments(runs)

    def add(self, seen: Instants) -> None:
        """Take the next instants; those outside the corner's time do not count."""
        corner = self.corner
        here = (seen.time >= corner.time - EDGE) & (seen.time <= corner.until + EDGE)
        if not here.any():
            return
        time, tip = seen.time[here], seen.tip[here]
        self.advance = np.maximum(self.advance, ((tip - corner.point) @ corner.incoming).max(axis=0))
        for t, out in zip(time, np.linalg.norm(tip - seen.reference[here], axis=-1) >= self.band, strict=True):
            self.settled_at[self.outside & ~out] = t
            self.outside = out
        half = 0.5 * (corner.time + corner.until)
        self.rates.add(np.linalg.norm(seen.deflection_rate[here][time >= half], axis=-1))

    def figures(self, run: int) -> CornerFigures:
        """Return what one run did after the corner so far."""
        settled = None if self.outside[run] else float(self.settled_at[run]) - self.corner.time
        return CornerFigures(self.corner.time, float(self.advance[run]), settled, float(self.rates.rms[run]))


class RunningFigures:
    """Gathers the figures of n runs along one reference while they go on.

    All runs are at the same instants. A run that ends early has no figures that compare: do not ask for them.
    """

    def __init__(
        self,
        runs: int,
        reference_corners: Sequence[Corner] = (),
        torque_limit: ArrayLike | None = None,
        band: float = BAND,
    ) -> None:
        """Begin before the first instant.

        Args:
            runs: how many.
            reference_corners: corners of the reference (`corners`).
            torque_limit: torque limit of shoulder and elbow [N m]; None: none, and no share of time at the limit.
            band: within which the tip has settled [m].
        """
        self.runs = integer("runs", runs, 1)
        self._limit = None if torque_limit is None else _limits(torque_limit)
        band = number("band", band, "m", above=0.0)
        self._watches = [_CornerWatch(corner, self.runs, band) for corner in reference_corners]
        self._distance, self._later = _Moments(runs), _Moments(runs)
        self._contour, self._lag = _Moments(runs), _Moments(runs)
        self._deflection, self._rate = _Moments(runs, 2), _Moments(runs, 2)
        self._torque, self._change, self._work = _Moments(runs, 2), _Moments(runs, 2), _Moments(runs, 2)
        self._travel, self._energy = np.zeros((runs, 2)), np.zeros((runs, 2))
        self._limited = np.zeros((runs, 2))
        self._before: Instants | None = None  # the newest instant
        self._torque_before: Array | None = None  # that acted until the newest instant. Shape (n, 2)

    def update(self, seen: Instants) -> None:
        """Take the next instants, one at least.

        Raises:
            ValueError: if shapes do not fit, or time does not go on.
        """
        seen = self._checked(seen)
        distance = np.linalg.norm(seen.tip - seen.reference, axis=-1)
        self._distance.add(distance)
        self._later.add(distance[seen.time >= SETTLED - EDGE])
        contour, lag = contour_and_lag(seen.tip, seen.reference, seen.direction)
        self._contour.add(contour)
        self._lag.add(lag)
        self._deflection.add(seen.deflection)
        self._rate.add(seen.deflection_rate)
        for watch in self._watches:
            watch.add(seen)
        self._add_periods(seen)
        self._before = Instants(*(values[-1:] for values in seen))

    def _checked(self, seen: Instants) -> Instants:
        seen = Instants(*(np.asarray(values, dtype=np.float64) for values in seen))
        instants = len(seen.time) if seen.time.ndim == 1 else 0
        if not instants:
            raise ValueError(f"time: must have shape (k,), k at least 1, got {seen.time.shape}")
        for name, values in list(seen._asdict().items())[1:]:
            if values.shape != (instants, self.runs, 2):
                raise ValueError(f"{name}: must have shape {(instants, self.runs, 2)}, got {values.shape}")
        times = seen.time if self._before is None else np.concatenate([self._before.time, seen.time])
        if not np.all(np.diff(times) > 0.0):
            raise ValueError(f"time = {shown(seen.time[0])} s: must go on from one instant to the next")
        return seen

    def _add_periods(self, seen: Instants) -> None:
        """Take the control periods that end at these instants: a torque acts between two of them."""
        if self._before is not None:
            seen = Instants(*(np.concatenate([old, new]) for old, new in zip(self._before, seen, strict=True)))
        torque = seen.torque[:-1]
        if not len(torque):
            return
        self._torque.add(torque)
        work = torque * np.diff(seen.joints, axis=0)
        self._work.add(work)
        self._energy += np.abs(work).sum(axis=0)
        if self._limit is not None:
            self._limited += (np.abs(torque) >= AT_LIMIT * self._limit).sum(axis=0)
        start = seen.time[:-1]  # of the periods
        if self._torque_before is None:
            start = start[1:]
        else:
            torque = np.concatenate([self._torque_before[None], torque])
        change = np.diff(torque, axis=0)
        self._travel += np.abs(change).sum(axis=0)
        self._change.add(change[start > SETTLED + EDGE])
        self._torque_before = torque[-1]

    def figures(self, run: int = 0, times_of_changes: Sequence[float] = ()) -> LapFigures:
        """Return the figures of one run so far.

        Args:
            run: which one.
            times_of_changes: when its elbow changed sides, as `elbow_changes` finds them [s].
        """
        settled = self._later.count > 0
        periods = max(self._torque.count, 1)
        return LapFigures(
            rms=float(self._distance.rms[run]),
            maximum=float(self._distance.largest[run]),
            rms_after_2s=float(self._later.rms[run]) if settled else None,
            maximum_after_2s=float(self._later.largest[run]) if settled else None,
            contour_rms=float(self._contour.rms[run]),
            contour_max=float(self._contour.largest[run]),
            lag_rms=float(self._lag.rms[run]),
            lag_max=float(self._lag.largest[run]),
            lag_mean=float(self._lag.mean[run]),
            corners=tuple(watch.figures(run) for watch in self._watches if np.isfinite(watch.advance[run])),
            peak_deflection=_pair(self._deflection.largest[run]),
            rms_deflection=_pair(self._deflection.rms[run]),
            peak_deflection_rate=_pair(self._rate.largest[run]),
            rms_deflection_rate=_pair(self._rate.rms[run]),
            peak_torque=_pair(self._torque.largest[run]),
            rms_torque=_pair(self._torque.rms[run]),
            torque_travel=_pair(self._travel[run]),
            torque_change_after_2s=_pair(self._change.rms[run]) if self._change.count else None,
            energy=float(self._energy[run].sum()),
            net_work=float(self._work.total[run].sum()),
            share_at_limit=None if self._limit is None else _pair(self._limited[run] / periods),
            elbow_changes=tuple(float(t) for t in times_of_changes),
        )


def _limits(given: ArrayLike) -> Array:
    limits = finite_values("torque_limit", given, np.inf)
    if limits.shape != (2,) or not np.all(limits > 0.0):
        raise ValueError(f"torque_limit = {shown(given)}: must be two positive torques, of shoulder and elbow")
    return limits


def _pair(values: Array) -> tuple[float, float]:
    return float(values[0]), float(values[1])
