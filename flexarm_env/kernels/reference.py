"""Drivers that follow the reference: where it is at the present instant. `imex` explains lanes, blocks and arenas."""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena, Clock
from flexarm_env.codegen.declarations import per_lane
from flexarm_env.kernels.block import Block
from flexarm_env.kernels.entries import clock_row
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.path_cache import cache_segment, on_segment, segment
from flexarm_env.kernels.variants import variant
from flexarm_env.physics.polyline import AHEAD


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
            k = cache_segment(arena, row.PRESENT_SEGMENT, paths, p, (clock[clock_row.STEPS, i] + AHEAD) * h, i)
            following = k + 1 if k + 2 < paths.shape[1] else 0
            arena[row.NEXT_TIME, i] = paths[p, following + 1, 0] - paths[p, following, 0]
            for r in range(2):
                arena[row.NEXT_VELOCITY + r, i] = paths[p, following, 3 + r]
    for i in range(variant.lanes):
        now = clock[clock_row.STEPS, i] * h
        for r in range(2):
            arena[row.REFERENCE + r, i] = on_segment(arena, row.PRESENT_SEGMENT, i, r, now)
            arena[row.REFERENCE + 2 + r, i] = arena[row.PRESENT_SEGMENT + segment.VELOCITY + r, i]


@per_lane
def segment_time(arena: Arena, clock: Clock, h: float, i: int) -> float:
    """Return the time of the lap that decides whether lane i's reference is still on its cached side [s]."""
    return (clock[clock_row.STEPS, i] + AHEAD) * h - arena[row.PRESENT_SEGMENT + segment.LAP, i]
