"""Drivers that write observations: previews of the reference, then the numbers of the selected blocks.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena, LaneRows, Mask, Observations
from flexarm_env.codegen.declarations import per_lane
from flexarm_env.codegen.intrinsics import TILE, write_tile
from flexarm_env.kernels.block import Block
from flexarm_env.kernels.entries import clock_row, setting, word
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.path_cache import segment
from flexarm_env.kernels.variants import variant
from flexarm_env.physics.polyline import reference_at


def write_previews(block: Block) -> None:
    """Write the displacement of the reference until each horizon, in the frame.

    The velocities of the present side and the next are cached, so that this is vectorised over the lanes; the path is
    searched only for horizons beyond them.
    """
    header, settings, arena, clock, paths = block.header, block.settings, block.arena, block.clock, block.paths
    for n in range(header[word.PREVIEWS]):
        horizon = settings[setting.HORIZONS + n]
        at = row.TAIL + 2 * n
        preview: LaneRows = arena[at : at + 2]
        beyond = 0
        for i in range(variant.lanes):
            along = min(horizon, arena[row.SEGMENT_LEFT, i])
            after = horizon - along
            x = along * arena[row.PRESENT_SEGMENT + segment.VELOCITY, i] + after * arena[row.NEXT_VELOCITY, i]
            y = along * arena[row.PRESENT_SEGMENT + segment.VELOCITY + 1, i] + after * arena[row.NEXT_VELOCITY + 1, i]
            write_preview(arena, preview, i, x, y)
            beyond += after > arena[row.NEXT_TIME, i]
        for i in range(variant.lanes if beyond > 0 else 0):
            if horizon - arena[row.SEGMENT_LEFT, i] > arena[row.NEXT_TIME, i]:
                time = clock[clock_row.STEPS, i] * settings[setting.STEP] + horizon
                there = reference_at(paths, clock[clock_row.PATH, i], time, time, -1e18)
                x, y = there[0] - arena[row.REFERENCE, i], there[1] - arena[row.REFERENCE + 1, i]
                write_preview(arena, preview, i, x, y)


@per_lane
def write_preview(arena: Arena, preview: LaneRows, i: int, x: float, y: float) -> None:
    """Write a displacement of lane i's reference [m], turned into the frame."""
    cosine, sine = arena[row.FRAME_AXIS, i], arena[row.FRAME_AXIS + 1, i]
    preview[0, i] = cosine * x + sine * y
    preview[1, i] = cosine * y - sine * x


def write_observations(block: Block, observations: Observations) -> None:
    """Write the observations of a block's active lanes; a lane whose state is not valid keeps its last one."""
    first, header, settings, arena, active = block.first, block.header, block.settings, block.arena, block.active
    factors = setting.HORIZONS + header[word.PREVIEWS]
    ours = observations[first : first + variant.lanes]
    count = 0
    for i in range(variant.lanes):
        count += is_written(arena, active, i)
    observed = header[word.OBSERVED]
    if variant.batch and count == variant.lanes and observed >= TILE:
        for i in range(0, variant.lanes, TILE):
            for n in range(0, observed, TILE):
                begin = min(n, observed - TILE)  # the last tile overlaps the one before
                write_tile(arena[:, i:], variant.lanes, header[word.PLACES :], settings[factors:], begin, ours[i:])
        return
    for i in range(variant.lanes):
        for n in range(header[word.OBSERVED] if is_written(arena, active, i) else 0):
            ours[i, n] = arena[header[word.PLACES + n], i] * settings[factors + n]


@per_lane
def is_written(arena: Arena, active: Mask, i: int) -> bool:
    """Return whether lane i is active and its state is valid."""
    status = arena[row.STATUS, i]
    return active[i] and (status == 0.0 or status < -1.5)
