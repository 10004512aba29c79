"""The board: computes the missing cells, and adds all cells up to JSON and tables."""

from __future__ import annotations

import csv
import io
import json
import platform
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tqdm import tqdm

from flexarm_agents.board.cells import Cell, Store, compute, jobs_of
from flexarm_agents.board.columns import COLUMNS, Column
from flexarm_agents.board.entries import Entry, all_entries
from flexarm_agents.board.summary import entry_summary
from flexarm_agents.board.tables import tables
from flexarm_agents.board.terms import BOARD, TASKS
from flexarm_agents.files import write_json, write_text
from flexarm_agents.jobs.executors import Executor
from flexarm_agents.jobs.failures import Failure
from flexarm_env.validation import choice

DATA, TABLE = "leaderboard.json", "leaderboard.csv"
PUBLISHED = Path(__file__).with_name(DATA)  # the whole board, as it was measured last; beside it is the schema
INCOMPLETE = "their entries lack cells, the cells that were computed are kept"  # after a failure
ALL = "all"  # in the place of all names
DIGITS = 6  # of the figures in the board's file


def chosen_entries(names: Sequence[str], without: Sequence[str] = (), added: Sequence[str] = ()) -> list[Entry]:
    """Return the entries with some names, and the added ones.

    Args:
        names: names of entries; where neither these nor `added` are given, all entries are chosen.
        without: names of entries to leave out.
        added: further entries, see `all_entries`.

    Raises:
        ValueError: for an unknown name.
    """
    entries, own = all_entries(added), [entry.name for entry in all_entries(())]
    for what, given in (("entries", names), ("without", without)):
        for name in given:
            choice(what, name, tuple(entry.name for entry in entries))
    every = not names and not added
    wanted = [entry for entry in entries if every or entry.name in names or entry.name not in own]
    return [entry for entry in wanted if entry.name not in without]


def chosen_columns(names: Sequence[str]) -> dict[str, Column]:
    """Return columns by their names, or "all"."""
    for name in names:
        choice("columns", name, (*COLUMNS, ALL))
    return {name: column for name, column in COLUMNS.items() if name in names or ALL in names}


def measure(
    entries: Sequence[Entry],
    columns: Mapping[str, Column],
    store: Store,
    where: Executor,
    progress: Callable[[int], tqdm[Any]] = lambda total: tqdm(total=total, disable=True),
) -> tuple[dict[str, Any], list[Failure]]:
    """Compute the missing cells; return the board of the entries that have all, and the jobs that failed."""
    cells = {
        entry.name: {name: [Cell.of(entry, point) for point in column.points] for name, column in columns.items()}
        for entry in entries
    }
    wanted = [cell for own in cells.values() for column in own.values() for cell in column]
    missing = store.missing(wanted)
    jobs, failed = jobs_of(missing), []
    with progress(len(missing)) as bar:
        for n, outcome in where.run(compute, jobs) if jobs else ():
            if isinstance(outcome, BaseException):
                failed.append(Failure(jobs[n][0].entry.name, outcome))
            else:
                for cell, result in zip(jobs[n], outcome, strict=True):
                    store.write(cell, result)
            bar.update(len(jobs[n]))
    whole = {
        entry.name: {name: list(map(store.read, column)) for name, column in cells[entry.name].items()}
        for entry in entries
    }
    found = [
        entry_summary(entry, columns, whole[entry.name])
        for entry in entries
        if all(one is not None for column in whole[entry.name].values() for one in column)
    ]
    return board(found, columns), failed


def board(entries: Sequence[Mapping[str, Any]], columns: Mapping[str, Column]) -> dict[str, Any]:
    """Put entries together to a board, as plain values."""
    names = ("flexarm", "gymnasium", "numpy", "numba", "scipy")
    return {
        "board": BOARD,
        "versions": {"python": platform.python_version(), **{name: version(name) for name in names}},
        "tasks": {
            name: {"figures": {key: one.plain() for key, one in task.figures.items()}, "best": task.best()}
            for name, task in TASKS.items()
        },
        "columns": {
            name: {
                "title": column.title,
                "unit": column.unit,
                "values": [point.value for point in column.points],
                "tasks": [point.task for point in column.points],
                "nominal": column.nominal,
            }
            for name, column in columns.items()
        },
        "rows": list(entries),
    }


def write(results: Mapping[str, Any], board: Mapping[str, Any], folder: Path) -> None:
    """Write JSON and CSV of what was measured, and the tables of a board, into a folder, which is made."""
    folder.mkdir(parents=True, exist_ok=True)
    shown = rounded(results)
    write_json(folder / DATA, shown, levels=5)
    write_text(folder / TABLE, as_csv(shown))
    for name, text in tables(board).items():
        write_text(folder / f"{name}.md", text)


def as_csv(results: Mapping[str, Any]) -> str:
    """Write all figures as CSV, a line for each entry, point, lap and figure; a quantile that is infinite is empty."""
    file = io.StringIO()
    writer = csv.writer(file, lineterminator="\n")
    counts, statistics = ("episodes", "lost", "first_loss"), ("median", "p90", "mean", "least", "most")
    writer.writerow(("entry", "column", "task", "value", "unit", "lap", *counts, "figure", "figure_unit", *statistics))
    for row in results["rows"]:
        for name, measured in row["columns"].items():
            column, points = results["columns"][name], measured["points"]
            values = column["values"] if len(points) == len(column["values"]) else ("all",)  # of one sample
            for value, task, point in zip(values, column["tasks"], points, strict=False):
                where = (row["name"], name, task, value, column["unit"])
                laps = {} if point is None or "not_applicable" in point else point
                for lap, found in laps.items():
                    for figure, about in results["tasks"][task]["figures"].items():
                        told = found[figure] or dict.fromkeys(statistics)
                        own = (figure, about["unit"], *(told[one] for one in statistics))
                        writer.writerow((*where, lap, *(found[one] for one in counts), *own))
    return file.getvalue()


def published() -> dict[str, Any] | None:
    """Return the shipped board; None if it is another version's."""
    found: dict[str, Any] = json.loads(PUBLISHED.read_text(encoding="utf-8"))
    return found if found["board"] == BOARD else None


def beside(results: Mapping[str, Any], others: Mapping[str, Any]) -> dict[str, Any]:
    """Return a board with the entries of another one that it has not measured; that one must have its points."""
    own = {entry["name"] for entry in results["rows"]}
    columns = {name: column for name, column in results["columns"].items() if name in others["columns"]}

    def at_its_points(name: str, measured: Mapping[str, Any]) -> dict[str, Any]:
        if COLUMNS[name].sample:
            return dict(measured)
        values = others["columns"][name]["values"]
        points = [measured["points"][values.index(value)] for value in columns[name]["values"]]
        return {**measured, "points": points}

    rows = [
        {**entry, "columns": {name: at_its_points(name, entry["columns"][name]) for name in columns}}
        for entry in others["rows"]
        if entry["name"] not in own
    ]
    return {**results, "columns": columns, "rows": [*results["rows"], *rows]}


def rounded(value: Any) -> Any:
    """Round figures for the board's file; cells have all digits."""
    if isinstance(value, dict):
        return {name: rounded(one) for name, one in value.items()}
    if isinstance(value, list):
        return [rounded(one) for one in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value
