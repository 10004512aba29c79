"""Drivers that put observations together: previews of the reference, then the numbers that are asked for.

Assembled and compiled like `stepping`, which explains lanes, blocks and arenas.
"""

from __future__ import annotations

from typing import Any

from flexarm_env.kernels.imex import PATH, STEPS
from flexarm_env.kernels.path_cache import SIDE_VELOCITY, reference_at

LANES = 1
TILE = 8
BATCH = False
STEP = PREVIEWS = OBSERVED = PLACES = HORIZONS = TAIL = 0
REFERENCE = SIDE_LEFT = PRESENT_SIDE = NEXT_VELOCITY = NEXT_TIME = FRAME_AXIS = STATUS = 0


def write_tile(rows: Any, distance: int, places: Any, factors: Any, n: int, lanes: Any) -> None:
    """Enter eight numbers of eight lanes, each scaled (`machine.write_tile`)."""
    raise NotImplementedError("the intrinsic exists in assembled modules only")


def write_previews(arena: Any, clock: Any, paths: Any, plan: Any, settings: Any) -> None:
    """Where the reference will have moved at each horizon, seen from where it is, in the frame.

    On its present side and the next it moves at known velocities, which the compiler works out for several lanes at
    once; only what lies beyond is searched for.
    """
    for n in range(plan[PREVIEWS]):
        horizon = settings[HORIZONS + n]
        row = TAIL + 2 * n
        preview = arena[row * LANES : (row + 2) * LANES]
        beyond = 0
        for i in range(LANES):
            along = min(horizon, arena[i + SIDE_LEFT * LANES])
            after = horizon - along
            x = along * arena[i + (PRESENT_SIDE + SIDE_VELOCITY) * LANES] + after * arena[i + NEXT_VELOCITY * LANES]
            y = (
                along * arena[i + (PRESENT_SIDE + SIDE_VELOCITY + 1) * LANES]
                + after * arena[i + (NEXT_VELOCITY + 1) * LANES]
            )
            write_preview(arena, preview, i, x, y)
            beyond += after > arena[i + NEXT_TIME * LANES]
        for i in range(LANES if beyond > 0 else 0):
            if horizon - arena[i + SIDE_LEFT * LANES] > arena[i + NEXT_TIME * LANES]:
                time = clock[STEPS, i] * settings[STEP] + horizon
                there = reference_at(paths, clock[PATH, i], time, time, -1e18)
                x, y = there[0] - arena[i + REFERENCE * LANES], there[1] - arena[i + (REFERENCE + 1) * LANES]
                write_preview(arena, preview, i, x, y)


def write_preview(arena: Any, preview: Any, i: int, x: float, y: float) -> None:
    """Enter a way of lane i's reference [m], turned into the frame."""
    cosine, sine = arena[i + FRAME_AXIS * LANES], arena[i + (FRAME_AXIS + 1) * LANES]
    preview[i] = cosine * x + sine * y
    preview[i + LANES] = cosine * y - sine * x


def write_observations(arena: Any, observations: Any, first: int, plan: Any, settings: Any, who: Any) -> None:
    """Gather the observations of some lanes of a block; one whose state is not valid keeps its last one."""
    factors = HORIZONS + plan[PREVIEWS]
    ours = observations[first : first + LANES]
    count = 0
    for i in range(LANES):
        count += shown(arena, who, i)
    observed = plan[OBSERVED]
    if BATCH and count == LANES and observed >= TILE:
        for i in range(0, LANES, TILE):
            for n in range(0, observed, TILE):
                begin = min(n, observed - TILE)  # the last tile repeats a part of the one before
                write_tile(arena[i:], LANES, plan[PLACES:], settings[factors:], begin, ours[i:])
        return
    for i in range(LANES):
        for n in range(plan[OBSERVED] if shown(arena, who, i) else 0):
            ours[i, n] = arena[i + plan[PLACES + n] * LANES] * settings[factors + n]


def shown(arena: Any, who: Any, i: int) -> bool:
    """Whether lane i is one of those observed, and its state is valid."""
    status = arena[i + STATUS * LANES]
    return who[i] and (status == 0.0 or status < -1.5)
