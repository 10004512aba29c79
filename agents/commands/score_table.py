"""Scores as tables for a terminal, in which each early end is marked."""

from collections import Counter
from collections.abc import Sequence

from flexarm_agents.commands.text import columns
from flexarm_agents.evaluation.races import FINISHED, RaceScore, RaceScores
from flexarm_agents.evaluation.scoring import Score, Spread, StandardScore, metres
from flexarm_env.laps import LAPS

LEGEND = "Pairs: shoulder / elbow, or link 1 / link 2. Lost laps have no errors."
SPREAD_LEGEND = """\
Errors: median [best .. worst] of the laps, where a lost lap counts as infinite; peaks: the largest of all
laps. Pairs: shoulder / elbow, or link 1 / link 2."""
GROUP_LEGEND = "Trainings of one setting, by their seeds; each counts with the median of its laps:"
_HEADER = (
    (*("", "lap", "r.m.s.", "after 2 s", "maximum"), *("torque change", "peak deflection", "peak torque", "end")),
    ("", "", "[m]", "r.m.s. [m]", "[m]", "r.m.s. [N m]", "[m]", "[N m]", ""),
)
_SPREAD_HEADER = (
    (
        *("", "lap", "r.m.s. [m]", "after 2 s r.m.s. [m]", "maximum [m]"),
        *("peak deflection [m]", "peak torque [N m]", "end"),
    ),
)
_GROUP_HEADER = (("trainings", "lap", "figure", "median [m]", "interquartile mean [m]", "best [m]", "worst [m]"),)
FIGURES = {"rms": "r.m.s.", "rms_after_2s": "after 2 s r.m.s.", "maximum": "maximum"}  # of a lap

Named = tuple[str, Sequence[StandardScore]]
Spreads = dict[str, dict[str, Spread]]  # by lap and figure


def legend(laps: int) -> str:
    """Return what the columns of `lap_table` mean."""
    return LEGEND if laps == 1 else SPREAD_LEGEND


def lap_table(title: str, results: Sequence[Named]) -> str:
    """Make a table with a row for each policy and lap, or race."""
    single = len(results[0][1]) == 1
    rows = [
        (name, lap, *(_figures(laps[0]) if single else _spreads(laps)))
        for name, scores in results
        for lap, laps in _rows_of(scores).items()
    ]
    return f"{title}\n{columns([*(_HEADER if single else _SPREAD_HEADER), *rows], right=True)}"


def _rows_of(scores: Sequence[StandardScore]) -> dict[str, tuple[Score, ...]]:
    """Return the scores of each lap, by its name; those of a race, which stand in the places of both laps, once."""
    laps = dict(zip(LAPS, zip(*scores, strict=True), strict=True))
    return {"race": laps["plain"]} if isinstance(scores[0], RaceScores) else laps


def group_table(groups: Sequence[tuple[str, Spreads]]) -> str:
    """Write a row for each figure of each lap, for each setting that was trained with several seeds."""
    rows = [
        (
            *(f"{name} ({spread.complete} of {spread.total} complete)", lap, FIGURES[figure]),
            *map(_metres, (spread.median, spread.interquartile_mean, spread.best, spread.worst)),
        )
        for name, spreads in groups
        for lap, figures in spreads.items()
        for figure, spread in figures.items()
    ]
    return f"{GROUP_LEGEND}\n{columns([*_GROUP_HEADER, *rows], right=True)}"


def spreads_of(scores: Sequence[StandardScore]) -> Spreads:
    """Return the spreads of the errors of each lap."""
    return {name: _errors_of(laps) for name, laps in zip(LAPS, zip(*scores, strict=True), strict=True)}


def _errors_of(laps: Sequence[Score]) -> dict[str, Spread]:
    return {figure: Spread.of(getattr(lap, figure) for lap in laps) for figure in FIGURES}


def _figures(score: Score) -> tuple[str, ...]:
    """Write the row of one lap, with a dash for what a run that ended early does not have."""
    return (
        *("-" if (value := getattr(score, figure)) is None else metres(value) for figure in FIGURES),
        pair(score.torque_change, 1),
        pair(score.peak_deflection, 2),
        pair(score.peak_torque, 0),
        _end(score),
    )


def _end(score: Score) -> str:
    if score.ended == FINISHED:
        return str(score)
    return "complete" if score.complete else f"ENDED at {score.duration:.2f} s: {score.ended}"


def _spreads(laps: Sequence[Score]) -> tuple[str, ...]:
    early = Counter(lap.ended for lap in laps if not lap.complete)
    reasons = ", ".join(f"{reason} {count}" for reason, count in early.most_common())
    end = f"{early.total()} of {len(laps)} ENDED: {reasons}" if early else f"{len(laps)} complete"
    if times := [lap.duration for lap in laps if lap.ended == FINISHED]:
        end += f", finished in {min(times):.2f} to {max(times):.2f} s"
    errors = [
        f"{_metres(each.median)} [{_metres(each.best)} .. {_metres(each.worst)}]" for each in _errors_of(laps).values()
    ]
    return (
        *(["-"] * len(FIGURES) if isinstance(laps[0], RaceScore) else errors),
        pair(_largest([lap.peak_deflection for lap in laps]), 2),
        pair(_largest([lap.peak_torque for lap in laps]), 0),
        end,
    )


def _largest(pairs: Sequence[tuple[float, float]]) -> tuple[float, float]:
    first, second = zip(*pairs, strict=True)
    return max(first), max(second)


def pair(values: tuple[float, float] | None, digits: int) -> str:
    """Write two numbers, of shoulder and elbow or of the links; one that would be 0 keeps one significant digit."""
    if values is None:
        return "-"
    return " / ".join(f"{value:.1g}" if 0.0 < value < 0.5 * 0.1**digits else f"{value:.{digits}f}" for value in values)


def _metres(value: float | None) -> str:
    """Write a statistic; "ended" where laps that ended early make it infinite."""
    return "ended" if value is None else metres(value)
