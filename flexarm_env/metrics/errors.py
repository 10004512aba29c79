"""Distances of the tip from the reference, and of one path from another."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from flexarm_env.metrics.window import instants, rms
from flexarm_env.simulation.trajectory import Trajectory
from flexarm_env.validation import shown

Array = NDArray[np.float64]


class TrackingError(NamedTuple):
    """Distance of a tip from the reference over a run [m].

    Attributes:
        rms: root mean square.
        maximum: largest distance.
        early_end: why the run ended early, None if it did not; figures of a part do not compare with a whole run's.
    """

    rms: float
    maximum: float
    early_end: str | None = None


class CircleFit(NamedTuple):
    """Least-squares circle through a path.

    Attributes:
        centre: x, y [m]. Shape (2,).
        radius: [m].
        deviation: r.m.s. distance of the path from the circle [m].
    """

    centre: Array
    radius: float
    deviation: float


def tracking_error(run: Trajectory, tip: str = "true", since: float = 0.0) -> TrackingError:
    """Return the distance of the tip from the (undelayed) reference, and why the run ended early, if it did.

    Args:
        run: a policy's run.
        tip: "true" or "rigid".
        since: from this time on [s].

    Raises:
        ValueError: for another `tip`, a run without a reference, or one without an instant from `since` on.
    """
    if tip not in ("true", "rigid"):
        raise ValueError(f"tip = {shown(tip)}: must be 'true' or 'rigid'")
    points = run.tip if tip == "true" else run.rigid_tip
    distance = np.linalg.norm(points - reference(run), axis=1)[instants(run.time, since, np.inf)]
    return TrackingError(rms(distance), float(distance.max()), early_end(run))


def early_end(run: Trajectory) -> str | None:
    """Return the reason for which the run ended before its full time, e.g. a limit of the state; None if it did not."""
    ended = run.notes.get("ended")
    return None if ended in (None, "truncated") else str(ended)


def reference(run: Trajectory) -> Array:
    """Return the run's reference positions [m]; refuse a run without. Shape (n, 2)."""
    if run.reference is None:
        raise ValueError("run.reference: the run has none; only runs of policies do")
    return run.reference


def overshoot(path: Array, time: Array, corner: Array, incoming: Array, window: tuple[float, float]) -> float:
    """Return how far a path goes past a corner, in the direction in which the reference came.

    Args:
        path: Shape (n, 2) [m].
        time: Shape (n,) [s].
        corner: x, y [m]. Shape (2,).
        incoming: direction of the side that ends at the corner, any length but 0. Shape (2,).
        window: first and last time that count [s].

    Returns:
        The largest advance past the corner [m]; negative if the path stays short of it.

    Raises:
        ValueError: if the window holds no instant, or the direction is 0.
    """
    length = float(np.linalg.norm(incoming))
    if not length > 0.0:
        raise ValueError(f"incoming = {shown(incoming)}: must be a direction, not 0")
    inside = instants(time, *window)
    return float(((path[inside] - corner) @ incoming).max() / length)


def path_difference(one: Array, other: Array) -> Array:
    """Return the distance of each point of a path from another path, whatever the time [m].

    The nearest sample of the other path is found first; the distance is then that to the two segments that meet there.

    Args:
        one: Shape (n, 2) [m].
        other: Shape (k, 2) [m].

    Returns:
        Shape (n,).
    """
    nearest = cKDTree(other).query(one)[1]
    before, after = np.maximum(nearest - 1, 0), np.minimum(nearest + 1, len(other) - 1)
    return np.minimum(_to_segment(one, other[before], other[nearest]), _to_segment(one, other[nearest], other[after]))


def _to_segment(points: Array, start: Array, end: Array) -> Array:
    side = end - start
    squared = np.maximum(np.sum(side**2, axis=1), np.finfo(float).tiny)  # a segment may be a point
    along = np.clip(np.sum((points - start) * side, axis=1) / squared, 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - (start + along[:, None] * side), axis=1))


def circle_fit(path: Array) -> CircleFit:
    """Fit a least-squares circle (Kasa's linear fit) to a path, and compute the path's distance from it.

    Args:
        path: Shape (n, 2) [m].
    """
    system = np.column_stack([2.0 * path, np.ones(len(path))])
    solution, *_ = np.linalg.lstsq(system, np.sum(path**2, axis=1), rcond=None)
    centre = solution[:2]
    radius = float(np.sqrt(solution[2] + centre @ centre))
    return CircleFit(centre, radius, rms(np.linalg.norm(path - centre, axis=1) - radius))
