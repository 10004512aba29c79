"""Figures of merit: pure functions of a `Trajectory`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from flexarm_env.physics.inverse_kinematics import elbow_side
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.trajectory import Trajectory
from flexarm_env.validation import shown

Array = NDArray[np.float64]


class TrackingError(NamedTuple):
    """Distance of a tip from the reference over a run [m]."""

    rms: float
    maximum: float


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


def _reference(run: Trajectory) -> Array:
    if run.reference is None:
        raise ValueError("run.reference: the run has none; only runs of policies do")
    return run.reference


def tracking_error(run: Trajectory, tip: str = "true", since: float = 0.0) -> TrackingError:
    """Return the distance of the tip from the (undelayed) reference.

    Args:
        run: a policy's run.
        tip: "true" or "rigid".
        since: from this time on [s].
    """
    if tip not in ("true", "rigid"):
        raise ValueError(f"tip = {shown(tip)}: must be 'true' or 'rigid'")
    points = run.tip if tip == "true" else run.rigid_tip
    distance = np.linalg.norm(points - _reference(run), axis=1)[_window(run.time, since, np.inf)]
    return TrackingError(float(np.sqrt(np.mean(distance**2))), float(distance.max()))


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
    inside = _window(time, *window)
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


def _window(time: Array, since: float, until: float) -> NDArray[np.bool_]:
    inside = (time >= since) & (time <= until)
    if not inside.any():
        raise ValueError(f"window = {since} to {until} s: holds no instant; the run covers {time[0]} to {time[-1]} s")
    return inside


def vibration(run: Trajectory, since: float = 0.0, until: float = np.inf) -> float:
    """Return the r.m.s. rate of the links' tip deflections, both links together [m/s].

    Args:
        run: any run.
        since: from this time on [s].
        until: up to this time [s].
    """
    arm = FlexibleArm(run.parameters)
    rates = arm.tip_deflection(run.state[:, arm.size :])[_window(run.time, since, until)]  # linear in the coordinates
    return float(np.sqrt(np.mean(np.sum(rates**2, axis=1))))


def tip_acceleration(run: Trajectory, since: float = 0.0, until: float = np.inf) -> float:
    """Return the r.m.s. acceleration of the rigid-kinematics tip, by second differences [m/s^2].

    Args:
        run: a run of at least 3 instants, evenly spaced.
        since: from this time on [s].
        until: up to this time [s].
    """
    step = run.time[1] - run.time[0]
    acceleration = np.diff(run.rigid_tip, n=2, axis=0) / step**2
    inside = _window(run.time[1:-1], since, until)
    return float(np.sqrt(np.mean(np.sum(acceleration[inside] ** 2, axis=1))))


def circle_fit(path: Array) -> CircleFit:
    """Fit a least-squares circle (Kasa's linear fit) and how far the path is from it.

    Args:
        path: Shape (n, 2) [m].
    """
    system = np.column_stack([2.0 * path, np.ones(len(path))])
    solution, *_ = np.linalg.lstsq(system, np.sum(path**2, axis=1), rcond=None)
    centre = solution[:2]
    radius = float(np.sqrt(solution[2] + centre @ centre))
    deviation = np.linalg.norm(path - centre, axis=1) - radius
    return CircleFit(centre, radius, float(np.sqrt(np.mean(deviation**2))))


def elbow_changes(run: Trajectory) -> Array:
    """Return when the elbow changed sides: the times at which the sign of sin(theta2) changed.

    The elbow is on a side only where it is bent by more than `STRAIGHT`, 0.05 rad, off the straight and off the folded
    arm (`elbow_side`; the environments' infos count by the same rule). A
    motion within that band, and one that comes back to the side that it left, is no change. The time of a change is
    the last at which theta2 passed 0 (or pi) on the way to the new side.

    Args:
        run: any run, sampled finely enough that theta2 moves by less than pi between two instants.

    Returns:
        Times [s], interpolated linearly between instants. Shape (changes,).
    """
    bend, sides = np.sin(run.state[:, 1]), elbow_side(run.state[:, 1])
    (bent,) = np.nonzero(sides)
    sides = sides[bent]
    (turns,) = np.nonzero(sides[1:] != sides[:-1])
    times = []
    for before, after in zip(bent[turns], bent[turns + 1], strict=True):
        (not_yet,) = np.nonzero(bend[before:after] * bend[after] <= 0.0)
        last = before + not_yet[-1]
        share = bend[last] / (bend[last] - bend[last + 1])
        times.append(run.time[last] + share * (run.time[last + 1] - run.time[last]))
    return np.array(times, dtype=float)


def ended_early(run: Trajectory) -> bool:
    """Return whether the run ended by anything but its full time, e.g. at a limit of the state (`notes["ended"]`)."""
    return run.notes.get("ended") not in (None, "truncated")


def summary(run: Trajectory) -> dict[str, object]:
    """Return the figures that every run is reported with; plain numbers, lengths in m, torques in N m.

    A run that ended early is a result of its own. All its figures of merit are None: means and maxima over the part
    that it survived would compare well with those of a whole run. Those after 2 s, the start's transient, are None for
    a run that is shorter.
    """
    early = ended_early(run)
    figures: dict[str, object] = {
        "ended": run.notes.get("ended"),
        "ended_early": early,
        "duration": float(run.time[-1]),
        "elbow_changes": elbow_changes(run).tolist(),
    }
    merits = _merits(run)
    return figures | (dict.fromkeys(merits) if early else merits)


def _merits(run: Trajectory) -> dict[str, object]:
    """Return the part of `summary` that compares controllers."""
    true, rigid = tracking_error(run), tracking_error(run, "rigid")
    later = tracking_error(run, since=2.0) if run.time[-1] >= 2.0 else None
    figures: dict[str, object] = {
        "true_tip_rms": true.rms,
        "true_tip_max": true.maximum,
        "true_tip_rms_after_2s": later.rms if later else None,
        "true_tip_max_after_2s": later.maximum if later else None,
        "rigid_tip_rms": rigid.rms,
        "rigid_tip_max": rigid.maximum,
        "peak_deflection": np.abs(run.tip_deflection).max(axis=0).tolist(),
        "peak_torque": np.abs(run.torque).max(axis=0).tolist(),
        "vibration": vibration(run),
    }
    if run.gain is not None:
        figures["mean_gain"] = float(run.gain[:-1].mean())
    return figures
