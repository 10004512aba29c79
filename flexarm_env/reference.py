"""Reference paths as pure functions of time: the square, its corners abrupt, laps following each other.

A path is a closed polyline travelled at constant speed on each side. The one rule that evaluates it
(`stepping.reference_at`) is compiled into the closed loop and used here as plain Python.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.parameters import ArmParameters, SquareParameters
from flexarm_env.stepping import reference_at
from flexarm_env.validation import choice, finite_array

Array = NDArray[np.float64]

_CORNERS = ("lower left", "upper left", "upper right", "lower right")  # clockwise
_SIGNS = np.array([(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)])


class ReferencePath:
    """A closed polyline with the times of its way-points.

    Attributes:
        table: way-points (time [s], x, y [m]); the last repeats the first one lap later. Shape (n, 3).
    """

    def __init__(self, table: ArrayLike) -> None:
        """Take the way-points.

        Args:
            table: see the attribute.

        Raises:
            ValueError: if times do not increase from 0, or the path is not closed.
        """
        points = finite_array("table", table, (None, 3))
        if len(points) < 2 or points[0, 0] != 0.0 or np.any(np.diff(points[:, 0]) <= 0.0):
            raise ValueError(f"table[:, 0] = {points[:, 0]}: times must increase from 0, two at least [s]")
        if np.any(points[0, 1:] != points[-1, 1:]):
            raise ValueError(f"table[-1, 1:] = {points[-1, 1:]}: must repeat the start {points[0, 1:]} [m]")
        self.table = points

    @property
    def lap_time(self) -> float:
        """Time of one lap [s]."""
        return float(self.table[-1, 0])

    def position(self, time: ArrayLike) -> Array:
        """Reference position [m]; before time 0 it rests at the start. Shape (..., 2)."""
        return self._evaluate(time)[..., :2]

    def velocity(self, time: ArrayLike) -> Array:
        """Reference velocity [m/s]; at a corner that of the side that begins there. Shape (..., 2)."""
        return self._evaluate(time)[..., 2:]

    def _evaluate(self, time: ArrayLike) -> Array:
        times = np.asarray(time, dtype=float)
        rows = [reference_at(self.table, t, t) for t in times.ravel().tolist()]
        return np.array(rows).reshape(*times.shape, 4)

    def check_reach(self, arm: ArmParameters) -> None:
        """Refuse a path that the arm's tip cannot reach with rigid links.

        Raises:
            ValueError: with the way-point or side and the distance by which it misses.
        """
        corners = self.table[:-1, 1:]
        distances = np.linalg.norm(corners, axis=1)
        worst = int(np.argmax(distances))
        miss = float(distances[worst]) - arm.reach
        if miss > 0.0:
            raise ValueError(
                f"path: way-point {tuple(map(float, corners[worst]))} m is {distances[worst]:.4g} m from the "
                f"shoulder; the tip reaches {arm.reach:.4g} m and misses it by {miss:.4g} m"
            )
        hole = abs(arm.link_lengths[0] - arm.link_lengths[1])
        nearest = min(_distance_to_origin(a, b) for a, b in zip(corners, np.roll(corners, -1, 0), strict=True))
        if nearest < hole:
            raise ValueError(
                f"path: it passes the shoulder at {nearest:.4g} m; links of {arm.link_lengths} m keep the tip "
                f"{hole:.4g} m away, which misses it by {hole - nearest:.4g} m"
            )


def _distance_to_origin(a: Array, b: Array) -> float:
    side = b - a
    along = np.clip(-(a @ side) / (side @ side), 0.0, 1.0)
    return float(np.linalg.norm(a + along * side))


def square(parameters: SquareParameters) -> ReferencePath:
    """The square centred on the shoulder, a quarter of the lap time for each side."""
    first = _CORNERS.index(parameters.start_corner)
    turn = 1 if parameters.direction == "clockwise" else -1
    order = [(first + turn * i) % 4 for i in range(5)]
    corners = 0.5 * parameters.side * _SIGNS[order]
    times = 0.25 * parameters.lap_time * np.arange(5.0)
    return ReferencePath(np.column_stack([times, corners]))


def inverse_kinematics(arm: ArmParameters, point: ArrayLike, elbow_branch: str) -> Array:
    """Joint angles that put the rigid arm's tip at a point.

    Args:
        arm: link lengths.
        point: x, y [m]. Shape (2,).
        elbow_branch: "positive" or "negative" theta2.

    Returns:
        (theta1, theta2) [rad]. Shape (2,).

    Raises:
        ValueError: if the point is out of reach, with the distance by which it is.
    """
    target = finite_array("point", point, (2,))
    choice("elbow_branch", elbow_branch, ("positive", "negative"))
    length1, length2 = arm.link_lengths
    distance = float(np.linalg.norm(target))
    miss = max(distance - arm.reach, abs(length1 - length2) - distance)
    if miss > 1e-12 * arm.reach:
        raise ValueError(f"point = {tuple(target.tolist())} m: out of the tip's reach by {miss:.4g} m")
    # by the half angle, which keeps its digits where the arm is straight or folded
    hole = abs(length1 - length2)
    bent = np.sqrt(max((arm.reach - distance) * (arm.reach + distance), 0.0))
    straight = np.sqrt(max((distance - hole) * (distance + hole), 0.0))
    theta2 = 2.0 * np.arctan2(bent, straight) * (1.0 if elbow_branch == "positive" else -1.0)
    bearing = np.arctan2(target[1], target[0])
    theta1 = bearing - np.arctan2(length2 * np.sin(theta2), length1 + length2 * np.cos(theta2))
    return np.array([theta1, theta2])
