"""Bring docs/validation.md, its pictures and its record up to date from a complete `results/validation`."""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path

import tyro

from scripts.common.markdown import DOCS, filled, quoting
from scripts.common.result_files import write_json
from scripts.docs.quoted import of_validation
from scripts.validation.groups import GROUPS

PAGE = "validation.md"
RECORD = "validation.json"  # what the text's figures are tested against
PICTURES = Path("figures") / "validation"


@dataclass
class Options:
    """Regenerate the tables and pictures of docs/validation.md."""

    results: Path = Path("results/validation")
    """A complete result folder of validate.py with default options."""
    docs: Path = DOCS
    """The folder to bring up to date."""


def main() -> None:
    """Command line."""
    options = tyro.cli(Options, prog="python -m scripts.docs.validation")
    summary = options.results / "summary.json"
    if not summary.exists():
        sys.exit(f"error: results = {options.results}: no complete results there; run `make validate` first")
    found = json.loads(summary.read_text())
    if found["quick"] or set(found["groups"]) != {group.name for group in GROUPS}:
        sys.exit(f"error: results = {options.results}: a quick run, or a part; the docs show the whole")
    page = options.docs / PAGE
    page.write_text(quoting(filled(page.read_text(), options.results), of_validation(found)))
    for group in found["groups"].values():
        del group["seconds"]  # the record tells what was found, not on which machine
    write_json(options.docs / RECORD, found)
    target = options.docs / PICTURES
    target.mkdir(parents=True, exist_ok=True)
    names = [name for group in GROUPS for name in group.drawings]
    for name in names:
        shutil.copyfile(options.results / "figures" / f"{name}.png", target / f"{name}.png")
    print(f"{page}: tables, figures in the text, {RECORD} and {len(names)} pictures up to date")


if __name__ == "__main__":
    main()
