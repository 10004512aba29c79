"""Bring docs/reproduction.md and its pictures up to date from a complete `results/paper`."""

import json
import shutil
import sys
from dataclasses import asdict, dataclass
from pathlib import Path

from scripts.common.command_line import read_options, run
from scripts.common.markdown import DOCS, blocks, filled, kept_tables, quoting
from scripts.docs.quoted import of_reproduction
from scripts.paper.cases import Study

PAGE = "reproduction.md"
PICTURES = (
    *(f"fig{name}" for name in ("2", "5a", "5b", "6a", "6b", "7a", "7b")),
    "rigid_and_true_tip",
    "alternatives",
    "true_tip_feedback",
    "sweep_constant_gain",
)


@dataclass
class Options:
    """Regenerate the tables, figures and pictures of docs/reproduction.md."""

    results: Path = Path("results/paper")
    """A complete result folder of `python -m scripts.paper` with default options."""
    docs: Path = DOCS
    """The folder to bring up to date."""
    pictures: bool = True
    """Copy the pictures too."""


def written(page: str, results: Path) -> str:
    """Write the generated tables and the quoted figures of a page's text anew.

    Raises:
        ValueError: if the results lack a table.
    """
    tables = kept_tables(results)
    if lacking := blocks(page).keys() - tables.keys():
        raise ValueError(f"results = {results}: lack the tables {', '.join(sorted(lacking))}")
    return quoting(filled(page, tables), of_reproduction(results))


def main() -> None:
    """Command line."""
    options = read_options("python -m scripts.docs.paper", Options())
    if not (options.results / "claims.json").exists():
        sys.exit(f"error: results = {options.results}: no complete results there; run `make reproduce` first")
    study = json.loads((options.results / "summary.json").read_text())["study"]
    if study != asdict(Study()):
        sys.exit(f"error: results = {options.results}: made with {study}; the docs show the defaults")
    page = options.docs / PAGE
    page.write_text(written(page.read_text(), options.results))
    print(f"{page}: tables up to date")
    if options.pictures:
        target = options.docs / "figures"
        target.mkdir(exist_ok=True)
        for name in PICTURES:
            shutil.copyfile(options.results / "figures" / f"{name}.png", target / f"{name}.png")
        print(f"{target}: {len(PICTURES)} pictures up to date")


if __name__ == "__main__":
    run(main)
