"""Drivers that put observations together: previews of the reference, then the numbers that are asked for.

Assembled and compiled like `stepping`, which explains lanes, blocks and arenas.
"""

from __future__ import annotations

from typing import Any

from flexarm_env.stepping import PATH, STEPS, reference_at

LANES = 1
STEP = PREVIEWS = OBSERVED = PLACES = HORIZONS = TAIL = 0
REFERENCE = SIDE_LEFT = FRAME_AXIS = STATUS = 0


def write_previews(arena: Any, clock: Any, paths: Any, plan: Any, settings: Any) -> None:
    """Where the reference will have moved at each horizon, seen from where it is, in the frame.

    On its present side it moves on at its velocity, which the compiler works out for several lanes at once; only what
    lies beyond the side's end is searched for.
    """
    for n in range(plan[PREVIEWS]):
        horizon = settings[HORIZONS + n]
        row = TAIL + 2 * n
        preview = arena[row * LANES : (row + 2) * LANES]
        turning = 0
        for i in range(LANES):
            preview[i] = arena[i + (REFERENCE + 2) * LANES] * horizon
            preview[i + LANES] = arena[i + (REFERENCE + 3) * LANES] * horizon
            turning += arena[i + SIDE_LEFT * LANES] < horizon
        for i in range(LANES if turning > 0 else 0):
            if arena[i + SIDE_LEFT * LANES] < horizon:
                time = clock[STEPS, i] * settings[STEP] + horizon
                there = reference_at(paths, clock[PATH, i], time, time, -1e18)
                preview[i] = there[0] - arena[i + REFERENCE * LANES]
                preview[i + LANES] = there[1] - arena[i + (REFERENCE + 1) * LANES]
        for i in range(LANES):
            x, y = preview[i], preview[i + LANES]
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
    if LANES > 1 and count == LANES:  # a row after the other: neighbouring lanes are read and scaled at once
        for n in range(plan[OBSERVED]):
            factor = settings[factors + n]
            values = arena[plan[PLACES + n] * LANES : (plan[PLACES + n] + 1) * LANES]
            for i in range(LANES):
                ours[i, n] = values[i] * factor
        return
    for i in range(LANES):
        for n in range(plan[OBSERVED] if shown(arena, who, i) else 0):
            ours[i, n] = arena[i + plan[PLACES + n] * LANES] * settings[factors + n]


def shown(arena: Any, who: Any, i: int) -> bool:
    """Whether lane i is one of those observed, and its state is valid."""
    status = arena[i + STATUS * LANES]
    return who[i] and (status == 0.0 or status < -1.5)
