"""What a lane keeps of the side of its path that it is on, so that following the reference needs no search."""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena, Paths
from flexarm_env.codegen.declarations import Entry, FixedNames, per_lane
from flexarm_env.physics.polyline import segment_of


class Segment(FixedNames):
    """What a lane notes of a side of its path, in rows of its arena that follow each other."""

    LAP = Entry("when its lap began", "s")
    BEGIN = Entry("when in the lap it begins", "s")
    END = Entry("when in the lap it ends", "s")
    START = Entry("where it begins", "m", 2)
    VELOCITY = Entry("of the reference on it", "m/s", 2)


segment = Segment()
SEGMENT_ROWS = sum(count for _, count in Segment.layout(None).values())


@per_lane
def cache_segment(arena: Arena, first: int, paths: Paths, p: int, time: float, i: int) -> int:
    """Note for lane i, from a row on, the side that path p is on at a time [s] (see `Segment`); which it is."""
    lap, k = segment_of(paths, p, time)
    arena[first + segment.LAP, i] = lap
    arena[first + segment.BEGIN, i] = paths[p, k, 0]
    arena[first + segment.END, i] = paths[p, k + 1, 0]
    for r in range(2):
        arena[first + segment.START + r, i] = paths[p, k, 1 + r]
        arena[first + segment.VELOCITY + r, i] = paths[p, k, 3 + r]
    return k


def invalidate_segment(arena: Arena, first: int, i: int) -> None:
    """Have lane i search for its side anew."""
    arena[first + segment.END, i] = -1e300


@per_lane
def on_segment(arena: Arena, first: int, i: int, r: int, time: float) -> float:
    """Coordinate r of lane i's reference at a time [s] on the side that is noted from a row on, as `reference_at`."""
    passed = time - arena[first + segment.LAP, i] - arena[first + segment.BEGIN, i]
    return arena[first + segment.START + r, i] + arena[first + segment.VELOCITY + r, i] * passed
