"""Measure controllers and agents on the board's tasks and axes; write tables, pictures and JSON.

Each cell, a row at a point, is kept in `cells/` under a hash of all that it depends on: an interrupted run goes on
where it was, and a changed policy recomputes its own row only. docs/submit.md tells how to add a row.
"""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass
from pathlib import Path

import tyro
from tqdm import tqdm

from flexarm_agents.board.cells import Store
from flexarm_agents.board.columns import COLUMNS, Column, measurable
from flexarm_agents.board.measure import DATA, INCOMPLETE, chosen_columns, chosen_rows, measure, write
from flexarm_agents.board.rows import Row
from flexarm_agents.board.summary import breaking
from flexarm_agents.board.tables import tables
from flexarm_agents.board.terms import BOARD
from flexarm_agents.commands.arguments import json_object
from flexarm_agents.commands.progress import Progress
from flexarm_agents.files import put
from flexarm_agents.jobs.executors import EXECUTORS, executor
from flexarm_agents.jobs.failures import check_failures
from flexarm_env.validation import choice
from scripts.common.command_line import run
from scripts.common.markdown import DOCS, filled
from scripts.common.result_files import write_json
from scripts.leaderboard.pictures import draw
from scripts.leaderboard.times import times, times_table

PICTURES = {
    "heat_map.png": "Share of laps that each entry loses along each axis, or its mean error",
    "delays.png": "Delays at which an entry loses no lap, and at which its error is at most doubled",
}
TIMES = "times.json"
PAGE = "leaderboard.md"


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
    without: tuple[str, ...] = ()
    """Names of rows to leave out."""
    times: bool = False
    """Measure how long each row takes to choose an action; the machine must be idle. Else the last figures stay."""
    docs: bool = False
    """Bring docs/leaderboard.md, its JSON and its pictures up to date."""
    measure: bool = True
    """Without it, only the tables and the pictures are made anew from docs/leaderboard.json."""


def update_docs(folder: Path) -> None:
    """Fill the tables of the page and of the README; copy the JSON and the pictures.

    Args:
        folder: has them. What it lacks stays as it is.
    """
    target = DOCS / "figures" / "leaderboard"
    target.mkdir(parents=True, exist_ok=True)
    for name, text in PICTURES.items():
        (folder / f"picture_{Path(name).stem}.md").write_text(f"![{text}](figures/leaderboard/{name})\n")
    for page in (DOCS / PAGE, DOCS.parent / "README.md"):
        page.write_text(filled(page.read_text(), folder, {path.stem for path in folder.glob("*.md")}))
        print(f"{page}: up to date")
    shutil.copyfile(folder / DATA, DOCS / DATA)
    for picture in (folder / "figures").glob("*.*"):
        if picture.name in PICTURES:
            shutil.copyfile(picture, target / picture.name)


def present(folder: Path) -> None:
    """Write the committed board's tables anew, and the pictures that need its figures only; see `Options.measure`."""
    results = json.loads((DOCS / DATA).read_text())
    for row in results["rows"]:
        for name, column in row["columns"].items():
            if "breaking" in column:
                column["breaking"] = breaking(COLUMNS[name], column["points"])
    shutil.rmtree(folder, ignore_errors=True)
    write(results, folder)
    draw(results, folder / "figures")
    update_docs(folder)


def chosen(options: Options) -> tuple[list[Row], dict[str, Column]]:
    """Return the rows and columns that are asked for.

    Raises:
        ValueError: for an unknown row, column or executor, or a page of less than the whole board.
    """
    choice("executor", options.executor, EXECUTORS)
    found = chosen_rows(options.rows, options.without, options.add), chosen_columns(options.columns)
    if options.docs and (options.rows or options.columns != tuple(COLUMNS)):
        raise ValueError("docs = True: the page shows the whole board; must go without rows and columns")
    if options.docs and not (options.times or (options.output / TIMES).is_file()):
        raise ValueError(f"docs = True: {options.output} has no {TIMES}; must go with times")
    return found


def main() -> None:
    """Command line.

    Raises:
        OSError: if cells could not be computed.
    """
    options = tyro.cli(Options, prog="python -m scripts.leaderboard")
    if not options.measure:
        present(options.output / "presented")
        return
    rows, columns = chosen(options)
    columns, left_out = measurable(columns)
    if left_out and options.docs:
        raise ValueError(f"docs = True: the page shows the whole board; {left_out}")
    if left_out:
        print(left_out)
    parameters = json_object(options.submitit)
    where = executor(options.executor, options.jobs, options.output / "submitit", parameters)
    store = Store(options.output / "cells")
    results, failed = measure(rows, columns, store, where, lambda total: Progress(total, "cells"))
    write(results, options.output)
    if options.times:
        with tqdm(total=len(rows), unit="row", desc="timing") as bar:
            found = times(rows, bar.update)
        write_json(options.output / TIMES, found)
        put(options.output / "times.md", lambda aside: aside.write_text(times_table(found)))
    draw(results, options.output / "figures")
    print(tables(results).get("ranking", ""), end="")
    print(f"{options.output}: board {BOARD}, {len(results['rows'])} of {len(rows)} rows")
    check_failures(failed, options.output, INCOMPLETE)
    if options.docs:
        update_docs(options.output)


if __name__ == "__main__":
    run(main)
