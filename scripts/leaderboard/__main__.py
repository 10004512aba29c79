"""Measure controllers and agents on the board's tasks and axes; write tables, pictures and JSON.

Each cell, a row at a point, is kept in `cells/` under a hash of all that it depends on: an interrupted run goes on
where it was, and a changed policy recomputes its own row only. docs/submit.md tells how to add a row.
"""

from __future__ import annotations

import platform
import shutil
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import tyro
from tqdm import tqdm

from flexarm_agents.board.cells import Cell, Store, compute, jobs_of
from flexarm_agents.board.columns import COLUMNS, Column
from flexarm_agents.board.rows import Row
from flexarm_agents.board.summary import row_summary
from flexarm_agents.board.terms import BOARD
from flexarm_agents.commands.arguments import json_object
from flexarm_env.validation import choice
from scripts.common.command_line import run
from scripts.common.executors import EXECUTORS, Executor, executor
from scripts.common.markdown import DOCS, filled
from scripts.common.result_files import write_json, write_whole
from scripts.leaderboard.animation import animate
from scripts.leaderboard.entries import entries
from scripts.leaderboard.margins import delay_margins
from scripts.leaderboard.pictures import SHOWN, draw
from scripts.leaderboard.references import references
from scripts.leaderboard.runs import nominal_runs
from scripts.leaderboard.tables import tables
from scripts.leaderboard.times import times, times_table

PICTURES = {
    "heat_map.png": "Largest mean error of each row along each axis, and the share of lost laps",
    "delays.png": "Delays with which no lap of a row is lost, and with which its error is below twice the nominal one",
    "corners.png": "The tip's paths where the reference begins and turns",
    "errors.png": "Error against time on both laps",
    "effort.png": "Error against effort, with the best plans known",
    "four.gif": "Four rows on the swing lap, at twice their speed",
}
TIMES = "times.json"
DIGITS = 6  # of the figures in the board's file
PAGE, DATA = "leaderboard.md", "leaderboard.json"


@dataclass
class Options:
    """The leaderboard."""

    rows: tuple[str, ...] = ()
    """Names of rows; without any, all: the controllers, the shipped policies, and those of `add`."""
    columns: tuple[str, ...] = tuple(COLUMNS)
    """Names of columns."""
    add: tuple[str, ...] = ()
    """Further rows: module:attribute, a training's folder or npz file; or a JSON file with the fields of a row."""
    output: Path = Path("results/leaderboard")
    """Folder for the results; its cells are taken over."""
    jobs: int = 2
    """Processes, or tasks of Slurm."""
    executor: str = "processes"
    """Where cells are computed: processes, ray, slurm, or submitit-local, a trial of slurm on this machine."""
    submitit: str = "{}"
    """Parameters of submitit as a JSON object, e.g. {"slurm_partition": "cpu"}."""
    pictures: bool = True
    """Draw pictures, for which the rows run nominal laps again."""
    without: tuple[str, ...] = ()
    """Names of rows to leave out."""
    times: bool = False
    """Measure how long each row takes to choose an action; the machine must be idle. Else the last figures stay."""
    docs: bool = False
    """Bring docs/leaderboard.md, its JSON and its pictures up to date."""


def measure(
    rows: Sequence[Row], columns: Mapping[str, Column], store: Store, where: Executor
) -> tuple[dict[str, Any], list[str]]:
    """Compute the missing cells, and add all up.

    Args:
        rows: who is measured.
        columns: on what, by name.
        store: has the cells, and gets those that are missing.
        where: computes them.

    Returns:
        The board of the rows that have all their cells, and why cells of the others could not be computed.
    """
    cells = {
        row.name: {name: [Cell.of(row, point) for point in column.points] for name, column in columns.items()}
        for row in rows
    }
    wanted = [cell for own in cells.values() for column in own.values() for cell in column]
    missing = store.missing(wanted)
    by_key = {cell.key: cell for cell in missing}
    jobs, failed = jobs_of(missing), []
    with tqdm(total=len(missing), unit="cell", desc=f"{len(wanted)} cells") as bar:
        for n, outcome in where.run(compute, jobs) if jobs else ():
            if isinstance(outcome, BaseException):
                failed.append(f"{jobs[n].row.name}: {outcome}")
            else:
                for key, result in zip(jobs[n].keys, outcome, strict=True):
                    store.write(by_key[key], result)
            bar.update(len(jobs[n].keys))
    whole = {
        row.name: {name: list(map(store.read, column)) for name, column in cells[row.name].items()} for row in rows
    }
    found = [
        row_summary(row, columns, whole[row.name]) | {"delay_margin": delay_margins(row)}
        for row in rows
        if all(one is not None for column in whole[row.name].values() for one in column)
    ]
    return board(found, columns), list(dict.fromkeys(failed))


def board(rows: Sequence[Mapping[str, Any]], columns: Mapping[str, Column]) -> dict[str, Any]:
    """Put rows together to a board, as plain values."""
    names = ("flexarm", "gymnasium", "numpy", "numba", "scipy")
    return {
        "board": BOARD,
        "versions": {"python": platform.python_version(), **{name: version(name) for name in names}},
        "references": references(),
        "columns": {
            name: {
                "title": column.title,
                "unit": column.unit,
                "values": [point.value for point in column.points],
                "nominal": column.nominal,
            }
            for name, column in columns.items()
        },
        "rows": list(rows),
    }


def write(results: Mapping[str, Any], folder: Path) -> None:
    """Write the board's JSON and tables."""
    write_json(folder / DATA, rounded(results), levels=5)
    for name, text in tables(results).items():
        write_whole(folder / f"{name}.md", lambda aside, text=text: aside.write_text(text))  # type: ignore[misc]


def illustrate(rows: Sequence[Row], results: Mapping[str, Any], folder: Path) -> None:
    """Draw the pictures, and an animation of four rows."""
    runs = nominal_runs(rows)
    draw(results, runs, folder)
    four = [name for name in SHOWN if name in runs][:4]
    if four:
        animate({name: runs[name]["swing"] for name in four}, folder / "four.gif")


def rounded(value: Any) -> Any:
    """Round figures for the board's file; cells have all digits."""
    if isinstance(value, dict):
        return {name: rounded(one) for name, one in value.items()}
    if isinstance(value, list):
        return [rounded(one) for one in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def update_docs(folder: Path) -> None:
    """Fill the page's tables; copy the JSON and the pictures."""
    page, target = DOCS / PAGE, DOCS / "figures" / "leaderboard"
    target.mkdir(parents=True, exist_ok=True)
    for name, text in PICTURES.items():
        (folder / f"picture_{Path(name).stem}.md").write_text(f"![{text}](figures/leaderboard/{name})\n")
    page.write_text(filled(page.read_text(), folder))
    shutil.copyfile(folder / DATA, DOCS / DATA)
    for name in PICTURES:
        shutil.copyfile(folder / "figures" / name, target / name)
    print(f"{page}: up to date")


def chosen(options: Options) -> tuple[list[Row], dict[str, Column]]:
    """Return the rows and columns that are asked for.

    Raises:
        ValueError: for an unknown row, column or executor, or a page of less than the whole board.
    """
    choice("executor", options.executor, EXECUTORS)
    for name in options.columns:
        choice("columns", name, tuple(COLUMNS))
    rows = entries(options.add)
    for what in ("rows", "without"):
        for name in getattr(options, what):
            choice(what, name, tuple(row.name for row in rows))
    if options.docs and (options.rows or options.columns != tuple(COLUMNS)):
        raise ValueError("docs = True: the page shows the whole board; must go without rows and columns")
    if options.docs and not (options.times or (options.output / TIMES).is_file()):
        raise ValueError(f"docs = True: {options.output} has no {TIMES}; must go with times")
    columns = {name: column for name, column in COLUMNS.items() if name in options.columns}
    wanted = [row for row in rows if not options.rows or row.name in options.rows]
    return [row for row in wanted if row.name not in options.without], columns


def main() -> None:
    """Command line.

    Raises:
        OSError: if cells could not be computed.
    """
    options = tyro.cli(Options, prog="python -m scripts.leaderboard")
    rows, columns = chosen(options)
    parameters = json_object(options.submitit)
    where = executor(options.executor, options.jobs, options.output / "submitit", parameters)
    results, failed = measure(rows, columns, Store(options.output / "cells"), where)
    write(results, options.output)
    if options.times:
        with tqdm(total=len(rows), unit="row", desc="timing") as bar:
            found = times(rows, bar.update)
        write_json(options.output / TIMES, found)
        write_whole(options.output / "times.md", lambda aside: aside.write_text(times_table(found)))
    if options.pictures:
        names = {row["name"] for row in results["rows"]}
        illustrate([row for row in rows if row.name in names], results, options.output / "figures")
    print(tables(results).get("ranking", ""), end="")
    print(f"{options.output}: board {BOARD}, {len(results['rows'])} of {len(rows)} rows")
    if failed:
        print(*failed, sep="\n", file=sys.stderr)
        raise OSError("the other rows lack cells, for the reasons above; what was computed is kept")
    if options.docs:
        update_docs(options.output)


if __name__ == "__main__":
    run(main)
