"""The corners of a reference: where and when it changes direction abruptly."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ABRUPT = 0.5  # [rad]; a larger turn is a corner. A curve of 100 chords a lap turns by 0.06 rad from one to the next


class Corner(NamedTuple):
    """A corner of the reference.

    Attributes:
        time: when the reference passes it [s].
        point: x, y [m]. Shape (2,).
        incoming: unit vector along which the reference came. Shape (2,).
        until: when the reference passes the next corner, or the reference ends [s].
    """

    time: float
    point: Array
    incoming: Array
    until: float


def directions(points: Array) -> Array:
    """Return the unit vector along which a polyline leaves each of its points.

    Where the polyline rests it keeps the direction of its last motion, and before its first motion that of the first.

    Args:
        points: Shape (n, 2) [m].

    Returns:
        Shape (n, 2); (1, 0) everywhere for a polyline that never moves.
    """
    steps = np.diff(points, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    (moving,) = np.nonzero(lengths > 0.0)
    if not len(moving):
        return np.tile([1.0, 0.0], (len(points), 1))
    latest = np.searchsorted(moving, np.arange(len(points)), side="right") - 1
    chosen = moving[np.maximum(latest, 0)]
    return np.asarray(steps[chosen] / lengths[chosen, None])


def corners(time: Array, points: Array) -> list[Corner]:
    """Find the corners of a reference, which is given as a polyline.

    A corner is a point at which the direction changes by more than `ABRUPT`, 0.5 rad; neither end of the polyline is
    one. A reversal after a rest is a corner at the instant at which the reference moves again.

    Args:
        time: when the reference is at each point [s]; increasing. Shape (n,).
        points: way-points or samples [m]. Shape (n, 2).
    """
    leaving = directions(points)
    turns = np.arccos(np.clip(np.sum(leaving[1:] * leaving[:-1], axis=1), -1.0, 1.0))
    found = [int(k) for k in np.flatnonzero(turns[:-1] > ABRUPT) + 1]
    ends = [*found[1:], len(time) - 1] if found else []
    return [
        Corner(float(time[k]), points[k].copy(), leaving[k - 1].copy(), float(time[end]))
        for k, end in zip(found, ends, strict=True)
    ]
