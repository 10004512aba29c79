"""Way-points with times, for the option `waypoints`: by speeds, from a function of time, with blended corners.

A square of 8 m whose corners are blended over 0.4 s, and a target that waits on its way:

    >>> import gymnasium
    >>> from flexarm_env import way_points
    >>> corners = [(-4.0, -4.0), (-4.0, 4.0), (4.0, 4.0), (4.0, -4.0)]
    >>> smooth = way_points.blended(way_points.at_speeds(corners, 2.0), 0.4)
    >>> env = gymnasium.make("flexarm_env:FlexArm/Track-v0", reference="waypoints", waypoints=smooth)
    >>> env.unwrapped.settings.lap_time
    16.0
    >>> waits = [(0.0, -4.0, 5.0), (2.0, 4.0, 5.0), (3.0, 4.0, 5.0), (5.0, -4.0, 5.0)]  # time [s], x, y [m]
    >>> env = gymnasium.make("flexarm_env:FlexArm/Track-v0", reference="waypoints", waypoints=waits)
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.physics.paths import FARTHEST, LARGEST_TIME, ReferencePath, parabolas, sides_of
from flexarm_env.validation import finite_array, number, real_array

Array = NDArray[np.float64]
LARGEST_SPEED = 1e6  # [m/s]
CLOSED = 1e-9  # [m]: ends that are nearer to each other are the same point
MOST = 100_000  # way-points


def at_speeds(points: ArrayLike, speeds: ArrayLike, closed: bool = True) -> Array:
    """Give way-points the times at which a target passes them.

    Args:
        points: x, y [m]; the first one is not repeated at the end. Shape (n, 2).
        speeds: on each side [m/s], a number for all or one for each. Shape (n,) if closed, else (n - 1,).
        closed: whether the path returns to its first point.

    Returns:
        Time [s], x, y [m]. Shape (n + 1, 3) if closed, else (n, 3).

    Raises:
        ValueError: for less than two points, two the same that follow each other, or speeds that are not above 0.
    """
    ends, lengths = sides_of("points", points, closed)
    given = real_array("speeds", speeds)
    fast = finite_array("speeds", np.full(len(lengths), given) if given.ndim == 0 else given, (len(lengths),))
    for n, speed in enumerate(fast.tolist()):
        number(f"speeds[{n}]", speed, "m/s", above=0.0, most=LARGEST_SPEED)
    return np.column_stack([np.concatenate([[0.0], np.cumsum(lengths / fast)]), ends])


def sampled(function: Callable[[float], ArrayLike], duration: float, period: float = 0.01) -> Array:
    """Sample a target that is a function of time.

    Args:
        function: from the time [s] to x, y [m]. A path that ends where it began is closed.
        duration: of a lap [s].
        period: between two way-points, about [s].

    Returns:
        Time [s], x, y [m]. Shape (n, 3).
    """
    times = _times(number("duration", duration, "s", least=1e-6, most=LARGEST_TIME), period)
    points = np.array([finite_array(f"function({t:g})", function(float(t)), (2,), FARTHEST) for t in times])
    if np.linalg.norm(points[-1] - points[0]) < CLOSED:
        points[-1] = points[0]
    return np.column_stack([times, points])


def blended(table: ArrayLike, blend: float, period: float = 0.01) -> Array:
    """Round a path's corners: a constant acceleration leads from each side's velocity to the next one's.

    The acceleration begins half of `blend` before a corner and ends as much after it (`physics.paths.parabolas`), so
    that times do not change and corners are cut. The option `corner_time` does the same to an environment's path.

    Args:
        table: time [s], x, y [m], as from `at_speeds`. A path that ends where it began is closed, and its first corner
            is blended, too. Shape (n, 3).
        blend: duration of each acceleration [s]; at most that of the shortest side.
        period: between two way-points of the result, about [s].

    Returns:
        Time [s], x, y [m]. Shape (k, 3).

    Raises:
        ValueError: for a bad table, or accelerations that overlap.
    """
    path = ReferencePath(table)
    blend = number("blend", blend, "s", least=0.0, most=float(np.diff(path.table[:, 0]).min()))
    times = _times(path.lap_time, period)
    return np.column_stack([times, parabolas(path, blend, times)])


def _times(duration: float, period: float) -> Array:
    count = int(np.ceil(duration / number("period", period, "s", least=duration / MOST, most=duration) - 1e-9))
    return np.linspace(0.0, duration, count + 1)
