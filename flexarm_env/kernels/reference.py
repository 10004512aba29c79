"""Drivers that follow the reference; a lane keeps the side of its path that it is on, which spares the search.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena, Clock, Paths
from flexarm_env.codegen.declarations import per_lane
from flexarm_env.kernels.entries import clock_row, segment
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import Block, variant
from flexarm_env.physics.polyline import AHEAD, segment_of


@per_lane
def path_time(arena: Arena, clock: Clock, h: float, ahead: float, i: int) -> float:
    """Return the time at which lane i's path is read, so many steps of h [s] ahead; of a race the way along it [m]."""
    if variant.racing:
        return arena[row.START_TIME, i] + arena[row.PROGRESS, i] + ahead * h
    return (clock[clock_row.STEPS, i] + ahead) * h


@per_lane
def lap_of(block: Block, i: int) -> float:
    """Return the time of a lap of lane i [s]; of a race its length [m]."""
    if variant.racing:
        return block.paths[block.clock[clock_row.PATH, i], block.paths.shape[1] - 1, 0]
    return block.arena[row.LAP, i]


@per_lane
def cache_segment(arena: Arena, first: int, paths: Paths, p: int, time: float, i: int) -> int:
    """Note for lane i, from a row on, the side that path p is on at a time [s] (`Segment`); return its number."""
    lap, k = segment_of(paths, p, time)
    arena[first + segment.LAP, i] = lap
    arena[first + segment.BEGIN, i] = paths[p, k, 0]
    arena[first + segment.END, i] = paths[p, k + 1, 0]
    for r in range(2):
        arena[first + segment.START + r, i] = paths[p, k, 1 + r]
        arena[first + segment.VELOCITY + r, i] = paths[p, k, 3 + r]
    return k


def invalidate_segment(arena: Arena, first: int, i: int) -> None:
    """Mark lane i's side as unknown: it is searched for anew."""
    arena[first + segment.END, i] = -1e300


@per_lane
def on_segment(arena: Arena, first: int, i: int, r: int, time: float) -> float:
    """Return coordinate r of lane i's reference at a time [s] on the noted side, as `reference_at` gives it."""
    passed = time - arena[first + segment.LAP, i] - arena[first + segment.BEGIN, i]
    return arena[first + segment.START + r, i] + arena[first + segment.VELOCITY + r, i] * passed


def follow_reference(block: Block, h: float) -> None:
    """Compute each lane's reference at the present instant.

    The side of the path is cached for each lane; it is searched for only where the cached side has ended.

    Args:
        block: the block.
        h: step [s].
    """
    arena, clock, paths = block.arena, block.clock, block.paths
    turning = 0
    for i in range(variant.lanes):
        turning += segment_time(arena, clock, h, i) >= arena[row.PRESENT_SEGMENT + segment.END, i]
    for i in range(variant.lanes if turning > 0 else 0):
        if segment_time(arena, clock, h, i) >= arena[row.PRESENT_SEGMENT + segment.END, i]:
            p = clock[clock_row.PATH, i]
            k = cache_segment(arena, row.PRESENT_SEGMENT, paths, p, path_time(arena, clock, h, AHEAD, i), i)
            following = k + 1 if k + 2 < paths.shape[1] else 0
            arena[row.NEXT_TIME, i] = paths[p, following + 1, 0] - paths[p, following, 0]
            for r in range(2):
                arena[row.NEXT_VELOCITY + r, i] = paths[p, following, 3 + r]
    for i in range(variant.lanes):
        now = path_time(arena, clock, h, 0.0, i)
        for r in range(2):
            arena[row.REFERENCE + r, i] = on_segment(arena, row.PRESENT_SEGMENT, i, r, now)
            if variant.racing:
                direction = arena[row.PRESENT_SEGMENT + segment.VELOCITY + r, i]
                arena[row.REFERENCE + 2 + r, i] = arena[row.REFERENCE_SPEED, i] * direction
            else:
                arena[row.REFERENCE + 2 + r, i] = arena[row.PRESENT_SEGMENT + segment.VELOCITY + r, i]


@per_lane
def segment_time(arena: Arena, clock: Clock, h: float, i: int) -> float:
    """Return the time of the lap that decides whether lane i's reference is still on its cached side [s]."""
    return path_time(arena, clock, h, AHEAD, i) - arena[row.PRESENT_SEGMENT + segment.LAP, i]
