"""`flexarm leaderboard`: rows of the board, and one's own, on its tasks and axes."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path

from flexarm_agents.board.cells import Store
from flexarm_agents.board.columns import COLUMNS, measurable
from flexarm_agents.board.measure import DATA, INCOMPLETE, chosen_columns, chosen_rows, measure, write
from flexarm_agents.board.tables import tables
from flexarm_agents.board.terms import BOARD
from flexarm_agents.commands.arguments import json_object, reader, width
from flexarm_agents.commands.progress import Progress
from flexarm_agents.commands.text import from_markdown
from flexarm_agents.jobs.executors import EXECUTORS, executor
from flexarm_agents.jobs.failures import check_failures

DESCRIPTION = f"""\
Measure controllers and policies on the leaderboard's tasks and axes: {", ".join(COLUMNS)}. Cells are kept in the
output folder under a hash of all that they depend on: an interrupted run goes on where it was, and a changed policy
computes its own row anew only. Without the extra `chain` the chain's cells are left out. A controller by linear
algebra or an agent takes minutes for all columns, a predictive controller most of an hour."""


def run(arguments: Sequence[str]) -> None:
    """Measure, write tables and JSON, print the ranking.

    Raises:
        OSError: if cells could not be computed.
    """
    parser = reader("leaderboard", DESCRIPTION)
    parser.add_argument("--rows", nargs="+", default=(), metavar="ROW", help="names of rows; without it, all")
    columns = "names of columns; without it, all"
    parser.add_argument("--columns", nargs="+", default=tuple(COLUMNS), metavar="COLUMN", help=columns)
    added = "further rows: module:attribute, a training's folder or npz file, or a JSON file with the fields of a row"
    parser.add_argument("--add", nargs="+", default=(), metavar="SOURCE", help=added)
    parser.add_argument("--without", nargs="+", default=(), metavar="ROW", help="names of rows to leave out")
    output = Path("results/leaderboard")
    parser.add_argument("--output", type=Path, default=output, help=f"folder; its cells are taken over; {output}")
    parser.add_argument("--jobs", type=int, default=2, metavar="N", help="processes, or tasks of Slurm; 2")
    parser.add_argument(
        "--executor", choices=EXECUTORS, default="processes", help="where cells are computed; processes"
    )
    parser.add_argument("--submitit", type=json_object, default={}, metavar="JSON", help="parameters of submitit")
    given = parser.parse_args(arguments)
    rows = chosen_rows(given.rows, given.without, given.add)
    chosen, left_out = measurable(chosen_columns(given.columns))
    if left_out:
        print(left_out, file=sys.stderr)
    where = executor(given.executor, given.jobs, given.output / "submitit", given.submitit)
    results, failed = measure(
        rows, chosen, Store(given.output / "cells"), where, lambda total: Progress(total, "cells")
    )
    write(results, given.output)
    found = tables(results)
    for text in [found["ranking"]] if "ranking" in found else found.values():
        print(f"{from_markdown(text, width())}\n")
    print(f"{given.output / DATA}: board {BOARD}, {len(results['rows'])} of {len(rows)} rows; tables beside it")
    check_failures(failed, given.output, INCOMPLETE)
