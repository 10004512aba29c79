"""Measure the board as `flexarm leaderboard` does; draw pictures, time the entries, bring the page up to date."""

import argparse
import json
import shutil
from collections.abc import Sequence
from pathlib import Path

from tqdm import tqdm

from flexarm_agents.board.columns import COLUMNS, measurable
from flexarm_agents.board.entries import Entry, all_entries
from flexarm_agents.board.measure import DATA, INCOMPLETE, PUBLISHED, write
from flexarm_agents.board.tables import tables
from flexarm_agents.board.terms import BOARD
from flexarm_agents.commands.arguments import Reader
from flexarm_agents.commands.leaderboard import measured
from flexarm_agents.commands.leaderboard import parser as parser_of_the_verb
from flexarm_agents.files import write_text
from flexarm_agents.jobs.failures import check_failures
from scripts.common.command_line import run
from scripts.common.markdown import DOCS, filled, kept_tables
from scripts.common.result_files import write_json
from scripts.leaderboard.pictures import draw
from scripts.leaderboard.times import times, times_table

PICTURES = {
    "columns.png": "Share of laps that each entry loses in each column, and the 90th percentile of its error",
    "pace.png": "Error over the lap time, of a few entries and of the best plans known",
}
MOST_ENTRIES = 10  # of a column's table on the page, the best ones; the data have all
TIMES = "times.json"
PAGE = "leaderboard.md"
SHOWN = (PAGE, "../README.md")  # pages with its tables


def update_docs(folder: Path) -> None:
    """Fill the pages by a folder's tables; copy its JSON and pictures. What it lacks stays as it is."""
    target = DOCS / "figures" / "leaderboard"
    target.mkdir(parents=True, exist_ok=True)
    tables = kept_tables(folder)
    for name in tables:
        if name in ("nominal", "robustness") or name.startswith("axis_"):
            tables[name] = "".join(tables[name].splitlines(keepends=True)[: 2 + MOST_ENTRIES])
    for name, text in PICTURES.items():
        tables[f"picture_{Path(name).stem}"] = f"![{text}](figures/leaderboard/{name})\n"
        if (folder / "figures" / name).exists():
            shutil.copyfile(folder / "figures" / name, target / name)
    for page in (DOCS / name for name in SHOWN):
        page.write_text(filled(page.read_text(), tables))
        print(f"{page}: up to date")
    shutil.copyfile(folder / DATA, PUBLISHED)


def time_entries(entries: Sequence[Entry], folder: Path) -> None:
    """Write how long entries take to choose an action, as JSON and as the page's table."""
    with tqdm(total=len(entries), unit="entry", desc="timing") as bar:
        found = times(entries, bar.update)
    write_json(folder / TIMES, found)
    write_text(folder / "times.md", times_table(found))


def present(folder: Path, timed: bool = False) -> None:
    """Write the committed board's tables anew, and the pictures that need its figures only; time the entries or not."""
    results = json.loads(PUBLISHED.read_text())
    shutil.rmtree(folder, ignore_errors=True)
    write(results, results, folder)
    draw(results, folder / "figures")
    if timed:
        time_entries(all_entries(()), folder)
    update_docs(folder)


def check(given: argparse.Namespace) -> None:
    """Refuse to show less than the whole board on the page, and a choice of what is measured where nothing is."""
    whole = f"{'no_measure' if given.no_measure else 'docs'} = True: the page shows the whole board"
    chosen = given.entries or given.without or given.add or tuple(given.columns) != tuple(COLUMNS)
    if chosen and (given.no_measure or given.docs):
        raise ValueError(f"{whole}; must go without entries, without, add and columns")
    if given.no_measure or not given.docs:
        return
    if left_out := measurable(COLUMNS)[1]:
        raise ValueError(f"{whole}; {left_out}")
    if not (given.times or (given.output / TIMES).is_file()):
        raise ValueError(f"docs = True: {given.output} has no {TIMES}; must go with times")


def parser() -> Reader:
    """Make the parser of the arguments: those of `flexarm leaderboard`, and three."""
    made = parser_of_the_verb()
    made.prog = "python -m scripts.leaderboard"
    made.set_defaults(columns=tuple(COLUMNS))
    timed = "time each entry on an idle machine; else the last times stay"
    made.add_argument("--times", action="store_true", help=timed)
    made.add_argument("--docs", action="store_true", help=f"bring docs/{PAGE}, its JSON and its pictures up to date")
    only = "make only the tables and pictures anew, from the committed data"
    made.add_argument("--no-measure", action="store_true", help=only)
    return made


def main() -> None:
    """Command line."""
    given = parser().parse_args()
    check(given)
    if given.no_measure:
        present(given.output / "presented", given.times)
        return
    entries, results, board, failed = measured(given)
    if given.times:
        time_entries(entries, given.output)
    draw(board, given.output / "figures")
    print(tables(board).get("ranking", ""), end="")
    print(f"{given.output}: board {BOARD}, {len(results['rows'])} of {len(entries)} entries")
    check_failures(failed, given.output, INCOMPLETE)
    if given.docs:
        update_docs(given.output)


if __name__ == "__main__":
    run(main)
