"""Reference paths as pure functions of time: the square and others, corners abrupt, laps following each other.

A path is a polyline travelled at constant speed on each side, closed or open. The one rule that evaluates it
(`polyline.reference_at`) is compiled into the closed loop and used here as plain Python.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.parameters import ArmParameters, SquareParameters
from flexarm_env.physics.inverse_kinematics import joint_angles_for
from flexarm_env.physics.polyline import reference_at
from flexarm_env.validation import choice, finite_array, finite_values, real_array, shown

Array = NDArray[np.float64]

FARTHEST = 1e6  # [m], of a way-point from the shoulder
LARGEST_TIME = 1e12  # [s]
_CORNERS = ("lower left", "upper left", "upper right", "lower right")  # clockwise
_SIGNS = np.array([(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)])


class ReferencePath:
    """A polyline with the times of its way-points; from an open one's end the reference jumps back to its start.

    Attributes:
        table: way-points (time [s], x, y [m]); the last one ends the lap. Shape (n, 3).
    """

    def __init__(self, table: ArrayLike) -> None:
        """Take the way-points.

        Args:
            table: see the attribute.

        Raises:
            ValueError: if times do not increase from 0, or a way-point is farther than `FARTHEST`.
        """
        points = finite_array("table", table, (None, 3), LARGEST_TIME)
        far = np.argwhere(np.abs(points[:, 1:]) > FARTHEST)
        if len(far):
            n, axis = far[0] + (0, 1)
            raise ValueError(f"table[{n}, {axis}] = {points[n, axis]}: must be at most {FARTHEST:g} in magnitude [m]")
        if len(points) < 2 or points[0, 0] != 0.0 or np.any(np.diff(points[:, 0]) <= 0.0):
            raise ValueError(f"table[:, 0] = {shown(points[:, 0])}: times must increase from 0, two at least [s]")
        self.table = points

    def __repr__(self) -> str:
        return f"{type(self).__name__}({len(self.table) - 1} way-points, {self.lap_time:g} s)"

    @property
    def rows(self) -> Array:
        """The table with the velocity from each way-point on, as `polyline.reference_at` reads it. Shape (n, 5)."""
        return with_velocities(self.table)

    @property
    def lap_time(self) -> float:
        """Time of one lap [s]."""
        return float(self.table[-1, 0])

    def position(self, time: ArrayLike) -> Array:
        """Return the reference position [m]; before time 0 it rests at the start. Shape (..., 2)."""
        return self._evaluate(time)[..., :2]

    def velocity(self, time: ArrayLike) -> Array:
        """Return the reference velocity [m/s]; at a corner that of the side that begins there. Shape (..., 2)."""
        return self._evaluate(time)[..., 2:]

    def _evaluate(self, time: ArrayLike) -> Array:
        times, paths = finite_values("time", time, LARGEST_TIME), self.rows[None]
        values = [reference_at(paths, 0, t, t, 0.0) for t in times.ravel().tolist()]
        return np.array(values).reshape(*times.shape, 4)

    def check_reach(self, arm: ArmParameters) -> None:
        """Refuse a path that the arm's tip cannot reach with rigid links.

        Raises:
            ValueError: with the way-point or side and the distance by which it misses.
        """
        corners = self.table[:, 1:]
        distances = np.linalg.norm(corners, axis=1)
        worst = int(np.argmax(distances))
        if miss := float(missed_by(arm, distances[worst])):
            reaches = (
                f"{arm.reach:.4g} m" if distances[worst] > arm.reach else f"no nearer than {arm.inner_reach:.4g} m"
            )
            raise ValueError(
                f"path: way-point {tuple(map(float, corners[worst]))} m is {distances[worst]:.4g} m from the "
                f"shoulder; the tip reaches {reaches} and misses it by {miss:.4g} m"
            )
        sides = np.diff(corners, axis=0)
        squared = np.maximum(np.sum(sides**2, axis=1), 1e-300)  # 0 where the reference waits
        along = np.clip(-np.sum(corners[:-1] * sides, axis=1) / squared, 0.0, 1.0)[:, None]
        nearest = float(np.linalg.norm(corners[:-1] + along * sides, axis=1).min())
        if miss := float(missed_by(arm, nearest)):
            raise ValueError(
                f"path: it passes the shoulder at {nearest:.4g} m; links of {arm.link_lengths} m keep the tip "
                f"{arm.inner_reach:.4g} m away, which misses it by {miss:.4g} m"
            )


def missed_by(arm: ArmParameters, distance: ArrayLike) -> Array:
    """Return by how much the rigid arm's tip misses points; 0 within its reach, to rounding error.

    Args:
        arm: link lengths.
        distance: of the points from the shoulder [m]. Shape (...).

    Returns:
        [m]. Shape (...).
    """
    miss = np.maximum(np.subtract(distance, arm.reach), np.subtract(arm.inner_reach, distance))
    return np.where(miss > 1e-12 * arm.reach, miss, 0.0)


def with_velocities(table: Array) -> Array:
    """Add the velocity from each way-point (time, x, y) on; the last one's is that of the first. Shape (n, 5)."""
    steps = np.diff(table, axis=0)
    velocities = steps[:, 1:] * (1.0 / steps[:, :1])
    return np.column_stack([table, np.concatenate([velocities, velocities[:1]])])


def by_distance(path: ReferencePath) -> ReferencePath:
    """Return a closed path with distances along it [m] in place of times, and without waits.

    Its velocities are unit vectors, its lap time is the length of a lap.

    Raises:
        ValueError: if it is open, or has no length.
    """
    points = path.table[:, 1:]
    if not np.array_equal(points[0], points[-1]):
        raise ValueError(f"waypoints: a race needs a closed path; it ends at {shown(points[-1])} m")
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    moving = lengths > 0.0
    if not moving.any():
        raise ValueError("waypoints: a race needs a path of some length")
    distances = np.concatenate([[0.0], np.cumsum(lengths[moving])])
    return ReferencePath(np.column_stack([distances, points[np.concatenate([[True], moving])]]))


def square(parameters: SquareParameters) -> ReferencePath:
    """Return the square centred on the shoulder, a quarter of the lap time for each side."""
    first = _CORNERS.index(parameters.start_corner)
    turn = 1 if parameters.direction == "clockwise" else -1
    order = [(first + turn * i) % 4 for i in range(5)]
    corners = 0.5 * parameters.side * _SIGNS[order]
    times = 0.25 * parameters.lap_time * np.arange(5.0)
    return ReferencePath(np.column_stack([times, corners]))


def circle(parameters: SquareParameters) -> ReferencePath:
    """Return the circle inscribed in the square, from its point nearest the start corner, at constant speed."""
    start = _SIGNS[_CORNERS.index(parameters.start_corner)]
    turn = -1.0 if parameters.direction == "clockwise" else 1.0
    angle = np.arctan2(start[1], start[0]) + turn * 2.0 * np.pi * _shares()
    return _curve(parameters, 0.5 * parameters.side * np.column_stack([np.cos(angle), np.sin(angle)]))


def line(parameters: SquareParameters) -> ReferencePath:
    """Return the square's first side and back; the velocity reverses at both ends."""
    corners = square(parameters).table[:2, 1:]
    return ReferencePath(np.column_stack([0.5 * parameters.lap_time * np.arange(3.0), corners[[0, 1, 0]]]))


def figure_eight(parameters: SquareParameters) -> ReferencePath:
    """Return a lying eight above the shoulder: 0.9 of the square's side wide, 0.3 high, centred 0.35 of it up."""
    turn = -1.0 if parameters.direction == "clockwise" else 1.0
    angle = turn * 2.0 * np.pi * _shares()
    x, y = 0.45 * np.sin(angle), 0.35 + 0.15 * np.sin(2.0 * angle)
    return _curve(parameters, parameters.side * np.column_stack([x, y]))


def stops(parameters: SquareParameters) -> ReferencePath:
    """Return the square with a rest at each corner: of a quarter lap two thirds move along a side, then one rests.

    The motion along a side is the polynomial of fifth degree from rest to rest (minimum jerk).
    """
    corners = square(parameters).table[:, 1:]
    side = np.minimum(np.arange(_STOP_POINTS) // (_STOP_POINTS // 4), 3)
    u = np.clip((np.arange(_STOP_POINTS) / (_STOP_POINTS // 4) - side) * 1.5, 0.0, 1.0)
    share = (u**3 * (10.0 + u * (6.0 * u - 15.0)))[:, None]
    points = np.vstack([corners[side] + share * (corners[side + 1] - corners[side]), corners[:1]])
    return ReferencePath(np.column_stack([parameters.lap_time * np.linspace(0.0, 1.0, _STOP_POINTS + 1), points]))


def way_points(parameters: SquareParameters, points: ArrayLike) -> ReferencePath:
    """Return a path through points of the user's.

    Args:
        parameters: its lap time, unless points have times.
        points: x, y [m], at least two, the first one not repeated at the end: a closed polyline at constant speed; or
            time [s], x, y [m], closed if the last point is the first one. Shape (n, 2) or (n, 3).

    Raises:
        ValueError: if times do not increase from 0, or without times two points that follow each other are the same, to
            rounding error of the lap.
    """
    given = real_array("waypoints", points)
    if given.ndim == 2 and given.shape[1] == 3:
        try:
            return ReferencePath(given)
        except ValueError as error:
            raise ValueError(str(error).replace("table", "waypoints", 1)) from None
    if given.ndim != 2 or given.shape[1] != 2:
        raise ValueError(f"waypoints: must have shape (n, 2) or (n, 3), got {given.shape}")
    closed, lengths = sides_of("waypoints", given)
    times = parameters.lap_time * np.concatenate([[0.0], np.cumsum(lengths) / np.sum(lengths)])
    times[-1] = parameters.lap_time
    steps = np.diff(times)
    if not np.all(steps > 0.0):
        n, lap = int(np.argmin(steps)), np.sum(lengths)
        raise ValueError(f"waypoints[{n}]: must be more than {lengths[n]:.3g} m from the next, in a lap of {lap:.6g} m")
    return ReferencePath(np.column_stack([times, closed]))


def sides_of(label: str, points: ArrayLike, closed: bool = True) -> tuple[Array, Array]:
    """Return points [m], the first one again where they are closed, and the lengths of the sides between them [m]."""
    corners = finite_array(label, points, (None, 2), FARTHEST)
    if len(corners) < 2:
        raise ValueError(f"{label}: must be at least 2 points, got {len(corners)}")
    ends = np.vstack([corners, corners[:1]]) if closed else corners
    lengths = np.linalg.norm(np.diff(ends, axis=0), axis=1)
    if not np.all(lengths > 0.0):
        raise ValueError(f"{label}[{int(np.argmin(lengths))}]: must differ from the point that follows it")
    return ends, lengths


def rounded(path: ReferencePath, corner_time: float) -> ReferencePath:
    """Return a path whose corners are blended: its mean over a window of `corner_time` about each instant.

    On straight sides that is the path itself. About a corner the velocity v changes to the next side's, v_next, at the
    constant acceleration (v_next - v) / corner_time (`parabolas`). The result is a polygon on that curve, whose corners
    are corner_time / 80 apart or the 16,000th part of the lap: 5 ms for 0.4 s.

    Args:
        path: closed, or open, whose ends then stay as they are.
        corner_time: [s]; at most the time of the shortest side. 0: the path as it is.

    Raises:
        ValueError: if it is longer than the shortest side.
    """
    if corner_time == 0.0:
        return path
    shortest = float(np.diff(path.table[:, 0]).min())
    if corner_time > shortest * (1.0 + 1e-9):
        raise ValueError(f"corner_time = {corner_time} s: must be at most {shortest:.6g} s, that of the shortest side")
    sides = min(int(np.ceil(_BLEND_SIDES * path.lap_time / corner_time - 1e-6)), _MOST_SIDES)
    times = np.linspace(0.0, path.lap_time, sides + 1)
    return ReferencePath(np.column_stack([times, parabolas(path, corner_time, times)]))


def parabolas(path: ReferencePath, blend: float, times: Array) -> Array:
    """Return positions on a path whose corners are blended, each by a constant acceleration.

    It begins half of `blend` before a corner and ends as much after it (linear segments with parabolic blends: Craig,
    *Introduction to Robotics*, 3rd ed., sec. 7.3). Where no side is shorter, that is the path's mean over `blend`.

    Args:
        path: closed, or open, whose ends then stay as they are.
        blend: [s]; at most the time of the shortest side.
        times: in increasing order, from 0 to the end of the lap [s]. Shape (n,).

    Returns:
        Shape (n, 2).
    """
    sides = np.diff(path.table, axis=0)
    velocities = sides[:, 1:] / sides[:, :1]
    closed = bool(np.all(path.table[0, 1:] == path.table[-1, 1:]))
    corners = path.table[:-1, 0] if closed else path.table[1:-1, 0]
    turns = velocities - np.roll(velocities, 1, axis=0) if closed else np.diff(velocities, axis=0)
    points = path.position(np.minimum(times, np.nextafter(path.lap_time, 0.0)))
    for corner, turn in zip(corners, turns, strict=True):
        since = times - corner
        if closed:  # the first corner is also the last one
            since = since - path.lap_time * np.round(since / path.lap_time)
        left = np.maximum(0.5 * blend - np.abs(since), 0.0)  # of the acceleration, on either side of the corner
        points += turn * (0.5 * left[:, None] ** 2 / max(blend, 1e-300))
    points[-1] = points[0] if closed else path.table[-1, 1:]
    return points


PATHS = {"square": square, "circle": circle, "line": line, "figure_eight": figure_eight, "stops": stops}
_STOP_POINTS = 2400  # sides of the polygon that stands for the moves and rests of `stops`
_BLEND_SIDES, _MOST_SIDES = 80, 16_000  # of a blended corner, of a path with such corners; evenly timed
_CURVE_POINTS = 1600  # sides of the polygon that stands for a curve: at 10 ms of the default lap one each


def _shares() -> Array:
    return np.linspace(0.0, 1.0, _CURVE_POINTS + 1)


def _curve(parameters: SquareParameters, points: Array) -> ReferencePath:
    points[-1] = points[0]  # closed to the last bit
    return ReferencePath(np.column_stack([parameters.lap_time * _shares(), points]))


def same_length(paths: Sequence[ReferencePath]) -> Array:
    """Return the tables of several paths with equally many way-points; sides of the shorter ones are divided evenly.

    Returns:
        Shape (paths, n, 5), see `ReferencePath.rows`.
    """
    sides = max(len(path.table) for path in paths) - 1
    return np.array([with_velocities(subdivided(path.table, sides)) for path in paths])


def subdivided(table: Array, sides: int) -> Array:
    """Divide a table's sides evenly, so that there are so many; at least as many as there are. Shape (sides + 1, 3)."""
    own = len(table) - 1
    if own == sides:
        return table
    pieces = np.full(own, sides // own)
    pieces[: sides % own] += 1
    rows = [table[:1]]
    for start, end, count in zip(table[:-1], table[1:], pieces, strict=True):
        inner = start + (end - start) * (np.arange(1, count)[:, None] / count)
        rows += [inner, end[None]]
    return np.concatenate(rows)


def inverse_kinematics(arm: ArmParameters, point: ArrayLike, elbow_branch: str = "positive") -> Array:
    """Return the joint angles that put the rigid arm's tip at a point.

    Args:
        arm: link lengths.
        point: x, y [m]. Shape (2,).
        elbow_branch: "positive" or "negative" theta2.

    Returns:
        (theta1, theta2) [rad]. Shape (2,).

    Raises:
        ValueError: if the point is out of reach, with the distance by which it is.
    """
    target = finite_array("point", point, (2,), FARTHEST)
    choice("elbow_branch", elbow_branch, ("positive", "negative"))
    if miss := float(missed_by(arm, np.linalg.norm(target))):
        raise ValueError(f"point = {tuple(target.tolist())} m: out of the tip's reach by {miss:.4g} m")
    branch = 1.0 if elbow_branch == "positive" else -1.0
    return np.array(joint_angles_for(*arm.link_lengths, branch, target[0], target[1]))
