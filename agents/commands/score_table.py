"""Scores as tables for a terminal, in which an early end is never without its mark."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from flexarm_agents.commands.text import columns
from flexarm_agents.score import Score
from flexarm_agents.spread import Spread

LEGEND = "Pairs: shoulder / elbow, or link 1 / link 2. *: with changed options. Laps that ended early have no errors."
SPREAD_LEGEND = """\
Errors: median [best .. worst] of the laps, where one that ended early counts as infinite; peaks: the largest of all
laps. Pairs: shoulder / elbow, or link 1 / link 2. *: with changed options."""
GROUP_LEGEND = "Trainings of one setting, by their seeds; each counts with the median of its laps:"
_HEADER = (
    ("", "environment", "lap r.m.s.", "maximum", "after 2 s", "torque change", "peak deflection", "peak torque", "end"),
    ("", "", "[m]", "[m]", "r.m.s. [m]", "r.m.s. [N m]", "[m]", "[N m]", ""),
)
_SPREAD_HEADER = (
    ("", "environment", "lap r.m.s. [m]", "after 2 s r.m.s. [m]", "peak deflection [m]", "peak torque [N m]", "end"),
)
_GROUP_HEADER = (("trainings", "figure", "median [m]", "interquartile mean [m]", "best [m]", "worst [m]"),)

Named = tuple[str, str, Sequence[Score]]


def lap_table(results: Sequence[Named]) -> str:
    """Make a table with a row for each policy.

    Args:
        results: name, environment and laps (one lap, or the same number each), in order.
    """
    if len(results[0][2]) == 1:
        rows = [(name, environment, *_figures(laps[0])) for name, environment, laps in results]
        return f"{LEGEND}\n{columns([*_HEADER, *rows], right=True)}"
    rows = [(name, environment, *_spreads(laps)) for name, environment, laps in results]
    return f"{SPREAD_LEGEND}\n{columns([*_SPREAD_HEADER, *rows], right=True)}"


def group_table(groups: Sequence[tuple[str, tuple[Spread, Spread]]]) -> str:
    """Write two rows for each setting that was trained with several seeds.

    Args:
        groups: names of the trainings, and the r.m.s. errors of the lap and after 2 s.
    """
    rows = [
        (f"{name} ({spread.complete} of {spread.total} complete)", figure, *_group_figures(spread))
        for name, spreads in groups
        for figure, spread in zip(("lap r.m.s.", "after 2 s r.m.s."), spreads, strict=True)
    ]
    return f"{GROUP_LEGEND}\n{columns([*_GROUP_HEADER, *rows], right=True)}"


def spreads_of(laps: Sequence[Score]) -> tuple[Spread, Spread]:
    """Return the r.m.s. errors over the lap, and after 2 s."""
    return Spread.of(lap.rms for lap in laps), Spread.of(lap.rms_after_2s for lap in laps)


def _figures(score: Score) -> tuple[str, ...]:
    """Write the row of one lap, with a dash for what a run that ended early does not have."""
    errors = (score.rms, score.maximum, score.rms_after_2s)
    return (
        *("-" if value is None else f"{value:.3f}" for value in errors),
        _pair(score.torque_change, 1),
        _pair(score.peak_deflection, 2),
        _pair(score.peak_torque, 0),
        "complete" if score.complete else f"ENDED at {score.duration:.2f} s: {score.ended}",
    )


def _spreads(laps: Sequence[Score]) -> tuple[str, ...]:
    """Write the row of several laps."""
    early = Counter(lap.ended for lap in laps if not lap.complete)
    reasons = ", ".join(f"{reason} {count}" for reason, count in early.most_common())
    return (
        *(f"{_metres(each.median)} [{_metres(each.best)} .. {_metres(each.worst)}]" for each in spreads_of(laps)),
        _pair(_largest([lap.peak_deflection for lap in laps]), 2),
        _pair(_largest([lap.peak_torque for lap in laps]), 0),
        f"{early.total()} of {len(laps)} ENDED: {reasons}" if early else f"{len(laps)} complete",
    )


def _group_figures(spread: Spread) -> tuple[str, ...]:
    return tuple(map(_metres, (spread.median, spread.interquartile_mean, spread.best, spread.worst)))


def _largest(pairs: Sequence[tuple[float, float]]) -> tuple[float, float]:
    first, second = zip(*pairs, strict=True)
    return max(first), max(second)


def _pair(values: tuple[float, float] | None, digits: int) -> str:
    """Write two numbers, of shoulder and elbow or of the links."""
    return "-" if values is None else " / ".join(f"{value:.{digits}f}" for value in values)


def _metres(value: float | None) -> str:
    """Return a statistic; where it is missing, laps that ended early decide it."""
    return "ended" if value is None else f"{value:.3f}"
