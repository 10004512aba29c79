"""`flexarm evaluate --sweep`: what one entry of the board does along one axis, as a table."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from flexarm_agents.board.columns import COLUMNS, Column, Point, measurable
from flexarm_agents.board.entries import Entry
from flexarm_agents.board.episodes import run_points
from flexarm_agents.board.summary import kept, merged, point_summary, spans
from flexarm_agents.commands.progress import progress_bar
from flexarm_agents.commands.sources import entry_of
from flexarm_agents.commands.text import columns
from flexarm_env.laps import LAPS
from flexarm_env.validation import choice

Summary = Mapping[str, Any]
LEGEND = """\
Errors of the laps, swing / plain: median and 90th percentile of all, of which a lost one is infinite; means of those
completed, over the lap and after 2 s. At the end, when the first lap was lost."""


def sweep(given: argparse.Namespace) -> dict[str, Any]:
    """Run the policies along an axis of the board, print a table for each, and return plain values for a file."""
    if not given.policies:
        raise ValueError("policies: nothing to sweep; name one, e.g. --policy ifdc")
    if given.arm is not None or given.laps != 1 or given.seed != 0 or given.own or given.pool:
        raise ValueError("arm, laps, seed, own, pool: the board sets them; they must be left out with --sweep")
    chosen, left_out = measurable({given.sweep: COLUMNS[choice("sweep", given.sweep, COLUMNS)]})
    if left_out:
        print(left_out, file=sys.stderr)
    column = chosen[given.sweep]
    written = []
    for source in given.policies:
        entry = entry_of(source, given, given.options)
        results = _results(entry, column.points)
        points = [point_summary(merged(results))] if column.sample else [point_summary(one) for one in results]
        print(_table(entry.name, column, points), end="\n\n")
        written.append({"row": entry.plain(), "results": results})
    return {"sweep": given.sweep, "rows": written}


def _results(entry: Entry, points: Sequence[Point]) -> list[dict[str, Any]]:
    """Run an entry at some points, one after the other, to show progress; the results are the same."""
    found = []
    with progress_bar(len(points), "points") as bar:
        for point in points:
            found += run_points(entry, [point])
            bar.update()
    return found


def _table(name: str, column: Column, points: Sequence[Summary | None]) -> str:
    """Write a line for each point: how many laps were lost, and the errors."""
    unit = f" [{column.unit}]" if column.unit else ""
    values = ["all"] if column.sample else [_number(one.value) for one in column.points]
    heads = ("lost", "median [m]", "90 % [m]", "completed laps [m]", "after 2 s [m]", "")
    rows = [(value, *_cells(point)) for value, point in zip(values, points, strict=True)]
    lines = f"{LEGEND}\n{columns([(f'{name}: {column.title.lower()}{unit}', *heads), *rows], right=True)}"
    if all(isinstance(point.value, float) for point in column.points):
        lines += f"\nno lap lost: {spans(kept(column, points)) or 'not at the nominal value'}"
    return lines


def _number(value: float | str) -> str:
    return f"{value:g}" if isinstance(value, float) else value


def _cells(point: Summary | None) -> tuple[str, ...]:
    if point is None or "not_applicable" in point:
        return *("-",) * 5, "" if point is None else f"not applicable: {point['not_applicable']}"
    laps = [point.get(lap, point.get("all")) for lap in LAPS]
    lost = " / ".join(f"{one['lost']} of {one['episodes']}" for one in laps)
    first = min((one["first_loss"] for one in laps if one["lost"]), default=None)
    return (
        lost,
        *(_errors(laps, "rms", what, "lost") for what in ("median", "p90")),
        *(_errors(laps, figure, "mean", "-") for figure in ("rms", "rms_after_2s")),
        "" if first is None else f"at {first:.2f} s",
    )


def _errors(laps: Sequence[Summary], figure: str, what: str, none: str) -> str:
    values = [None if one[figure] is None else one[figure][what] for one in laps]
    return " / ".join(none if value is None else f"{value:.3f}" for value in values)
