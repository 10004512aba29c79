"""The one rule that evaluates a path, a polyline travelled lap after lap, in kernels and in plain Python (`paths`)."""

from __future__ import annotations

from numpy import floor

from flexarm_env.codegen.arrays import Four, Paths
from flexarm_env.codegen.declarations import per_lane

# The present side is sought so many steps ahead: at a corner it is the one that begins there, whatever the rounding.
AHEAD = 1e-9


@per_lane
def segment_of(paths: Paths, p: int, time: float) -> tuple[float, int]:
    """Return the time at which the present lap of path p began, and the number of its side, at a time [s]."""
    last = paths.shape[1] - 1
    lap = paths[p, last, 0]
    before = floor(time / lap) * lap  # laps done
    within = time - before
    k = min(int(within * last / lap), last - 1)  # right at once where way-points are evenly timed
    if (within >= paths[p, k + 1, 0]) | (within < paths[p, k, 0]):  # one rare branch, which the processor foresees
        while k < last - 1 and within >= paths[p, k + 1, 0]:
            k += 1
        while k > 0 and within < paths[p, k, 0]:
            k -= 1
    return before, k


@per_lane
def reference_at(paths: Paths, p: int, time: float, side: float, since: float) -> Four:
    """Return the reference position and velocity on a polyline; at the end of a lap the next one begins.

    Args:
        paths: way-points (time [s], x, y [m], velocity from there on x', y' [m/s]), the last one ending the lap.
            Shape (paths, n, 5).
        p: which of the paths. (A view of one would be counted by reference, which takes longer than all the rest.)
        time: where to evaluate [s].
        side: picks the side where `time` is at a corner: a time on it [s].
        since: before this time the reference rests where it is then [s].

    Returns:
        x, y [m], x', y' [m/s].
    """
    moving = 1.0
    if side < since:
        time = since
        side = since
        moving = 0.0
    before, k = segment_of(paths, p, side)
    vx = paths[p, k, 3]
    vy = paths[p, k, 4]
    passed = time - before - paths[p, k, 0]
    return paths[p, k, 1] + vx * passed, paths[p, k, 2] + vy * passed, moving * vx, moving * vy


def chord_at(paths: Paths, p: int, time: float, h: float, since: float) -> Four:
    """Return position [m] at a time [s], and mean velocity [m/s] over the step h [s] that begins there, on path p."""
    start = reference_at(paths, p, time, time, since)
    end = reference_at(paths, p, time + h, time + h, since)
    return start[0], start[1], (end[0] - start[0]) / h, (end[1] - start[1]) / h
