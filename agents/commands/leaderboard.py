"""`flexarm leaderboard`: entries of the board, and one's own, on its tasks and axes."""

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from flexarm_agents.board.cells import Store
from flexarm_agents.board.columns import COLUMNS, DRAWN, PART, measurable, phases
from flexarm_agents.board.entries import Entry
from flexarm_agents.board.measure import (
    ALL,
    DATA,
    INCOMPLETE,
    beside,
    chosen_columns,
    chosen_entries,
    measure,
    published,
    write,
)
from flexarm_agents.board.tables import lap_ranking, place, tables
from flexarm_agents.board.terms import BOARD
from flexarm_agents.commands.arguments import Reader, json_argument, of_verb, width
from flexarm_agents.commands.progress import progress_bar
from flexarm_agents.commands.text import from_markdown
from flexarm_agents.files import check_place
from flexarm_agents.jobs.executors import EXECUTORS, executor
from flexarm_agents.jobs.failures import Failure, check_failures

HEADLINE = tuple(name for name, column in COLUMNS.items() if column.headline)
DESCRIPTION = f"""\
Measure controllers and policies on the leaderboard's columns, and print their places among all entries, whose figures
come along. Columns: {", ".join(COLUMNS)}; {" and ".join(HEADLINE)} decide the rank and are computed first, with a first
page after {PART} of {DRAWN} unknown arms. On one core these two take half a minute for an agent or a fixed linear
controller, two minutes for an adaptive one, and nine minutes for a predictive controller; all columns take up to four
times as long. Cells are kept in the output folder under a hash of all that they depend on: an interrupted run goes on
where it was, and a changed policy computes its own entry only. Without the extra `chain` the chain's cells are left
out."""


def parser() -> Reader:
    """Return the parser of the arguments."""
    reader = of_verb("leaderboard", DESCRIPTION)
    entries = "names of entries to measure; without it those of --add alone, or all"
    reader.add_argument("--entries", nargs="+", default=(), metavar="ENTRY", help=entries)
    columns = f"names of columns, or {ALL}; {' '.join(HEADLINE)}"
    reader.add_argument("--columns", nargs="+", default=HEADLINE, metavar="COLUMN", help=columns)
    added = (
        "further entries: module:attribute, a training's folder or npz file, or a JSON file with the fields of an entry"
    )
    reader.add_argument("--add", nargs="+", default=(), metavar="SOURCE", help=added)
    reader.add_argument("--without", nargs="+", default=(), metavar="ENTRY", help="names of entries to leave out")
    output = Path("results/leaderboard")
    reader.add_argument("--output", type=Path, default=output, help=f"folder, whose cells are reused; {output}")
    reader.add_argument("--jobs", type=int, default=2, metavar="N", help="processes, or tasks of Slurm; 2")
    reader.add_argument(
        "--executor", choices=EXECUTORS, default="processes", help="where cells are computed; processes"
    )
    reader.add_argument("--submitit", type=json_argument, default={}, metavar="JSON", help="parameters of submitit")
    return reader


def measured(given: argparse.Namespace) -> tuple[list[Entry], dict[str, Any], dict[str, Any], list[Failure]]:
    """Measure what is chosen; write its figures, and tables in which it stands among all entries.

    Return the chosen entries, a board of those that are whole, the same with the published figures of all other entries
    where some were named, and the failures.
    """
    entries = chosen_entries(given.entries, given.without, given.add)
    chosen, left_out = measurable(chosen_columns(given.columns))
    if left_out:
        print(left_out, file=sys.stderr)
    where = executor(given.executor, given.jobs, given.output / "submitit", given.submitit)
    check_place("output", given.output / DATA)
    store = Store(given.output / "cells")
    for columns in phases(chosen):
        results, failed = measure(entries, columns, store, where, lambda total: progress_bar(total, "cells"))
        board = beside(results, published() or results) if given.entries or given.add else results
        write(results, board, given.output)
    return entries, results, board, failed


def run(arguments: Sequence[str]) -> None:
    """Measure, write tables and data, print the ranking; an error says which cells could not be computed."""
    given = parser().parse_args(arguments)
    entries, results, board, failed = measured(given)
    ranks = {"nominal", "unknown"} <= board["columns"].keys()
    for text in [lap_ranking(board)] if ranks else tables(results).values():
        print(f"{from_markdown(text, width())}\n")
    for entry in entries if ranks else ():
        if rank := place(board, entry.name):
            print(f"{entry.name}: rank {rank[0]} of {rank[1]}")
    whole = f"{len(results['rows'])} of {len(entries)} entries"
    print(f"{given.output / DATA}: board {BOARD}, {whole}; the tables beside it have all")
    check_failures(failed, given.output, INCOMPLETE)
