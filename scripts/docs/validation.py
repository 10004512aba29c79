"""Bring docs/validation.md, its tables, docs/plant.md, pictures and record up to date from `results/validation`."""

from __future__ import annotations

import json
import shutil
import sys
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from scripts.common.command_line import read_options, run
from scripts.common.markdown import DOCS, filled, quoting
from scripts.common.result_files import write_json
from scripts.docs.quoted import of_validation
from scripts.validation.checks import check_of
from scripts.validation.groups import GROUPS
from scripts.validation.runner import Outcome, table_of_all, table_of_group

PAGES = ("validation.md", "plant.md")
TABLES = "developers/validation_tables.md"  # page of all checks
QUOTING_PAGES = ("model.md", "../README.md")  # quote figures and show no table of the validation
RECORD = "validation.json"  # what the text's figures are tested against
PICTURES = Path("figures") / "validation"


@dataclass
class Options:
    """Regenerate the tables and pictures of docs/validation.md and docs/plant.md."""

    results: Path = Path("results/validation")
    """A complete result folder of validate.py with default options."""
    docs: Path = DOCS
    """The folder to bring up to date."""
    part: bool = False
    """Renew the groups that the results hold; the others stay as recorded."""


def renewed(record: dict[str, Any], found: dict[str, Any]) -> dict[str, Any]:
    """Return a record with the groups of newer results, in the groups' order.

    Args:
        record: that is committed.
        found: what a part of the groups found.
    """
    of = {group.name: found if group.name in found["groups"] else record for group in GROUPS}
    of = {name: source for name, source in of.items() if name in source["groups"]}
    checks = [check for name, source in of.items() for check in source["checks"] if check["group"] == name]
    return {
        "quick": record["quick"] or found["quick"],
        "passed": all(check["passed"] for check in checks),
        "groups": {name: source["groups"][name] for name, source in of.items()},
        "checks": checks,
    }


def tables_of(record: dict[str, Any]) -> dict[str, str]:
    """Return the tables of a record for the page, by their blocks' names."""
    outcomes: list[Outcome] = []
    tables: dict[str, str] = {}
    for group in GROUPS:
        plain = [{k: v for k, v in check.items() if k != "passed"} for check in record["checks"]]
        checks = [check_of(check) for check in plain if check["group"] == group.name]
        outcomes.append(Outcome(group, checks))
        tables |= {group.name: table_of_group(checks), **record["groups"][group.name]["tables"]}
    return {"summary": table_of_all(outcomes), **tables}


def main() -> None:
    """Command line."""
    options = read_options("python -m scripts.docs.validation", Options())
    summary = options.results / "summary.json"
    if not summary.exists():
        sys.exit(f"error: results = {options.results}: no complete results there; run `make validate` first")
    found = json.loads(summary.read_text())
    for group in found["groups"].values():
        del group["seconds"]  # the record tells what was found, not on which machine
    new = [group for group in GROUPS if group.name in found["groups"]]
    if options.part:
        found = renewed(json.loads((options.docs / RECORD).read_text()), found)
    if found["quick"] or set(found["groups"]) != {group.name for group in GROUPS}:
        sys.exit(f"error: results = {options.results}: a quick run, or a part; the docs show the whole (see --part)")
    with TemporaryDirectory() as folder:
        for name, text in tables_of(found).items():
            (Path(folder) / f"{name}.md").write_text(text)
        for name in (*PAGES, TABLES):
            page = options.docs / name
            page.write_text(filled(page.read_text(), Path(folder)))
    for name in (*PAGES, *QUOTING_PAGES):
        page = options.docs / name
        page.write_text(quoting(page.read_text(), of_validation(found)))
    write_json(options.docs / RECORD, found)
    target = options.docs / PICTURES
    target.mkdir(parents=True, exist_ok=True)
    names = [name for group in new for name in group.drawings]
    for name in names:
        shutil.copyfile(options.results / "figures" / f"{name}.png", target / f"{name}.png")
    print(f"{', '.join((*PAGES, TABLES, *QUOTING_PAGES, RECORD))} and {len(names)} pictures up to date")


if __name__ == "__main__":
    run(main)
