"""Drivers that put observations together: previews of the reference, then the numbers that are asked for.

Assembled and compiled like `stepping`, which explains lanes, blocks and arenas.
"""

from __future__ import annotations

from math import floor
from typing import Any

from flexarm_env.stepping import PATH, side_at

LANES = 1
PREVIEWS = OBSERVED = PLACES = HORIZONS = TAIL = 0
REFERENCE = LAP = PHASE = FRAME_AXIS = AHEAD = STATUS = 0


def write_previews(arena: Any, clock: Any, paths: Any, plan: Any, settings: Any) -> None:
    """Where the reference will have moved at each horizon, seen from where it is, in the frame."""
    last = paths.shape[1] - 1
    for n in range(plan[PREVIEWS]):
        for i in range(LANES):
            lap = arena[i + LAP * LANES]
            time = arena[i + PHASE * LANES] * lap + settings[HORIZONS + n]
            time = time - floor(time / lap) * lap if time >= lap else time
            arena[i + AHEAD * LANES] = time
            arena[i + (AHEAD + 1) * LANES] = min(floor(time * (last / lap)), last - 1.0)
        if write_preview(arena, clock, paths, n) > 0:
            for i in range(LANES):
                guess = int(arena[i + (AHEAD + 1) * LANES])
                arena[i + (AHEAD + 1) * LANES] = side_at(paths, clock[PATH, i], arena[i + AHEAD * LANES], guess)
            write_preview(arena, clock, paths, n)


def write_preview(arena: Any, clock: Any, paths: Any, n: int) -> int:
    """Preview n from the time of the lap and the side that AHEAD holds.

    Without a search in the loop, the compiler works on several lanes at once.

    Returns:
        How many lanes are on another side; where way-points are evenly timed, hardly ever one.
    """
    row = TAIL + 2 * n
    preview = arena[row * LANES : (row + 2) * LANES]
    astray = 0
    for i in range(LANES):
        p = clock[PATH, i]
        time, k = arena[i + AHEAD * LANES], max(int(arena[i + (AHEAD + 1) * LANES]), 0)
        astray += (time >= paths[p, k + 1, 0]) | (time < paths[p, k, 0])
        passed = time - paths[p, k, 0]
        x = paths[p, k, 1] + paths[p, k, 3] * passed - arena[i + REFERENCE * LANES]
        y = paths[p, k, 2] + paths[p, k, 4] * passed - arena[i + (REFERENCE + 1) * LANES]
        cosine = arena[i + FRAME_AXIS * LANES]
        sine = arena[i + (FRAME_AXIS + 1) * LANES]
        preview[i] = cosine * x + sine * y
        preview[i + LANES] = cosine * y - sine * x
    return astray


def write_observations(arena: Any, observations: Any, first: int, plan: Any, settings: Any, who: Any) -> None:
    """Gather the observations of some lanes of a block; one whose state is not valid keeps its last one."""
    factors = HORIZONS + plan[PREVIEWS]
    ours = observations[first : first + LANES]
    count = 0
    for i in range(LANES):
        count += shown(arena, who, i)
    if count == LANES:  # a row after the other: neighbouring lanes are read and scaled at once
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
