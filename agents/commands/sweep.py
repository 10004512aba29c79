"""`flexarm evaluate --sweep`: what one entry of the board does along one axis, as a table."""

import argparse
import sys
import textwrap
from collections.abc import Mapping, Sequence
from typing import Any

from flexarm_agents.board.columns import COLUMNS, Column, Point, measurable
from flexarm_agents.board.entries import Entry
from flexarm_agents.board.episodes import run_points
from flexarm_agents.board.summary import kept, point_summaries, spans, value_text
from flexarm_agents.board.terms import TASKS, BoardTask
from flexarm_agents.commands.progress import progress_bar
from flexarm_agents.commands.sources import entry_of
from flexarm_agents.commands.text import columns
from flexarm_env.validation import choice

Summary = Mapping[str, Any]
LEGEND = """\
{text}, {laps}: median and 90th percentile of all, of which a lost one is infinite; mean of those completed{after}. At
the end, when the first one was lost."""
AFTER = "rms_after_2s"  # figure of laps that the table has beside a point's headline


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
        print(_table(entry.name, column, point_summaries(column, results)), end="\n\n")
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
    """Write a line for each point, in a table for all tasks with the same laps and headline figure."""
    axis = f" [{column.unit}]" if column.unit else ""
    values = ["all"] if column.sample else [value_text(one.value) for one in column.points]
    parts: dict[tuple[Any, ...], tuple[BoardTask, list[tuple[str, Summary | None]]]] = {}
    for value, point, found in zip(values, column.points, points, strict=False):  # of a sample there is one line
        task = TASKS[point.task]
        kind = task.laps, task.headline, AFTER in task.figures
        parts.setdefault(kind, (task, []))[1].append((value, found))
    head = f"{name}: {column.title.lower()}{axis}"
    lines = "\n\n".join(_part(head, task, rows) for task, rows in parts.values())
    if all(isinstance(point.value, float) for point in column.points):
        bound = "" if column.bound is None else f", mean errors below {column.bound:g} m"
        lines += f"\nno lap lost{bound}: {spans(kept(column, points)) or 'not at the nominal value'}"
    return lines


def _part(head: str, task: BoardTask, points: Sequence[tuple[str, Summary | None]]) -> str:
    """Write a line for each point of a task: how many laps were lost, and the task's headline figure."""
    figure, more = task.figures[task.headline], [AFTER] * (AFTER in task.figures)
    heads = ["lost", *(f"{what} [{figure.unit}]" for what in ("median", "90 %", "completed"))]
    heads += [*(f"after 2 s [{task.figures[name].unit}]" for name in more), ""]
    rows = [(value, *_cells(point, task.headline, [task.headline, *more])) for value, point in points]
    text = f"{figure.text[0].upper()}{figure.text[1:]}"
    laps = " / ".join(f"{lap} lap" for lap in task.laps if lap) or "each episode"
    legend = textwrap.fill(LEGEND.format(text=text, laps=laps, after=", and the same from 2 s on" * len(more)), 110)
    return f"{legend}\n{columns([(head, *heads), *rows], right=True)}"


def _cells(point: Summary | None, headline: str, means: Sequence[str]) -> tuple[str, ...]:
    if point is None or "not_applicable" in point:
        absent = "" if point is None else f"not applicable: {point['not_applicable']}"
        return *("-",) * (3 + len(means)), absent
    laps = list(point.values())
    lost = " / ".join(f"{one['lost']} of {one['episodes']}" for one in laps)
    first = min((one["first_loss"] for one in laps if one["lost"]), default=None)
    return (
        lost,
        *(_figures(laps, headline, what, "lost") for what in ("median", "p90")),
        *(_figures(laps, figure, "mean", "-") for figure in means),
        "" if first is None else f"at {first:.2f} s",
    )


def _figures(laps: Sequence[Summary], figure: str, what: str, none: str) -> str:
    values = [None if one[figure] is None else one[figure][what] for one in laps]
    return " / ".join(none if value is None else f"{value:.3f}" for value in values)
