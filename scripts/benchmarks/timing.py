"""Takes the time of subjects by turns, so that a ratio compares moments that lie side by side.

Time is the processor's, spent by this process and all its threads: what the clock on the wall shows on a quiet machine,
and nearly the same on a busy one. The wall clock's median stands beside it.

The `effort` of what declares groups and subjects is a factor on the work of a timed call.
"""

import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

UNITS = {"s": 1.0, "ms": 1e3, "us": 1e6, "ns": 1e9}


@dataclass(frozen=True)
class Subject:
    """Something whose time is taken."""

    name: str  # for the tables
    work: Callable[[], Mapping[str, float] | None]  # one timed call; it may return the seconds of its parts by name
    amount: float = 1.0  # how many units of work a call does
    prepare: Callable[[], Any] | None = None  # an untimed call before each timed one; here a kernel is compiled
    at_most: int | None = None  # so many repeats at most; None for as many as the group's


@dataclass(frozen=True)
class Ratio:
    """How many times longer `slow` takes than `fast`, repeat by repeat."""

    slow: str  # name of a subject
    fast: str  # the same
    says: str  # what the ratio means, in words


@dataclass(frozen=True)
class Group:
    """Subjects that are timed by turns."""

    name: str  # key in the JSON file
    title: str  # for people
    unit: str  # unit of the times, a key of `UNITS`
    per: str  # what one unit of work is
    subjects: Sequence[Subject]  # what is timed
    ratios: Sequence[Ratio]  # what is compared
    wall: bool = False  # the work is done by other processes, so that only the clock on the wall counts
    warm: bool = True  # do every subject's work once before the first timed call
    share: float = 1.0  # factor on the option `repeats`

    def repeats(self, wanted: int) -> int:
        """How often each subject is timed; twice at least."""
        return max(2, round(self.share * wanted))


def measure(group: Group, repeats: int, tick: Callable[[], Any]) -> dict[str, Any]:
    """Time a group, and return its entry in the JSON file."""
    samples: dict[str, list[float]] = {}
    walls: dict[str, list[float]] = {}
    if group.warm:
        for subject in group.subjects:
            _timed(subject, {}, {})
    for repeat in range(group.repeats(repeats)):
        for subject in group.subjects if repeat % 2 == 0 else group.subjects[::-1]:
            if subject.at_most is None or repeat < subject.at_most:
                _timed(subject, samples, walls)
                tick()
    if group.wall:
        samples |= walls
    return {
        "title": group.title,
        "unit": f"{group.unit} per {group.per}",
        "clock": "wall" if group.wall else "processor",
        "times": {name: _rated(values, walls[name], group.unit) for name, values in samples.items()},
        "ratios": [_compare(ratio, samples) for ratio in group.ratios],
    }


def _timed(subject: Subject, samples: dict[str, list[float]], walls: dict[str, list[float]]) -> None:
    if subject.prepare is not None:
        subject.prepare()
    wall, processor = time.perf_counter(), time.process_time()
    parts = subject.work()
    processor, wall = time.process_time() - processor, time.perf_counter() - wall
    samples.setdefault(subject.name, []).append(processor / subject.amount)
    walls.setdefault(subject.name, []).append(wall / subject.amount)
    for name, seconds in (parts or {}).items():
        walls.setdefault(f"{subject.name}: {name}", []).append(seconds)


def _compare(ratio: Ratio, samples: Mapping[str, list[float]]) -> dict[str, Any]:
    pairs = zip(samples[ratio.slow], samples[ratio.fast], strict=False)  # as many as both have
    return {"says": ratio.says, "slow": ratio.slow, "fast": ratio.fast} | _summary([a / b for a, b in pairs])


def _rated(values: Sequence[float], walls: Sequence[float], unit: str) -> dict[str, float]:
    median, scale = statistics.median(values), UNITS[unit]
    rate = {"per_second": 1.0 / median, "wall": scale * statistics.median(walls)}
    return _summary([scale * x for x in values]) | rate


def _summary(values: Sequence[float]) -> dict[str, float]:
    return {"median": statistics.median(values), "min": min(values), "max": max(values), "repeats": len(values)}
