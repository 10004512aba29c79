"""Bring docs/validation.md, docs/plant.md, their pictures and record up to date after `make validate`.

The report is pytest's, as JUnit XML; the properties of its tests hold checks, tables and quoted figures
(`tests/validation/conftest.py`). The pictures lie beside it.
"""

import json
import shutil
import sys
import xml.etree.ElementTree as ET
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from scripts.common.command_line import read_options, run
from scripts.common.markdown import DOCS, filled, quoting, span, table
from scripts.common.result_files import write_json

# Titles of the page's sections, by the modules and packages of tests/validation, in the order of the page.
GROUPS = {
    "links": "Single links",
    "arm": "Two-link arm",
    "engine": "Independent engine (MuJoCo)",
    "cables": "Second engine (Exudyn)",
    "two_engines": "Two engines compared",
    "plant": "The default arm on the chain",
    "drift": "Invariants over ten minutes",
    "orders": "Orders of the integrators",
    "steps": "Error of the integration step",
    "coriolis": "The paper's dropped Coriolis terms",
}
PAGES = ("validation.md", "plant.md")
QUOTING_PAGES = ("model.md", "../README.md")  # quote figures and show no table of the validation
RECORD = "validation.json"  # what the text's figures are tested against
ALL = "developers/validation_tables.md"  # the record as a page, which the site has
# What the tables are that only the record has, by their names.
CAPTIONS = {
    "arm_errors": "Error of the first / the second elastic frequency [%], the largest over the elbow angles.",
    "engine_errors": "Errors at amplitude 1. Angles below 10 Hz: raw ones have no limit where torques jump.",
    "engine_parts": "The tip errors by their order in the amplitude. To first order both theories agree (truncation). "
    "The rest comes from the assumption of small deflections. Last: order of growth from half the amplitude.",
    "engine_limits": "Deflection of a link's tip over its length at which the r.m.s. tip error over 2 s passes 10 and "
    "50 mm, the smallest of a kind's programmes. '>': the largest deflection that all of them reached.",
    "engine_spins": "Largest spin tried at which a weak and a strong kick stay within 10 and 50 mm over 1 s.",
    "engine_square": "Errors on the square.",
    "cables_convergence": "Change of the cables' tip by mesh and step.",
    "two_engines_distances": "Distances from both engines.",
    "plant_damping": "The swing lap of `student_unknown` on the chain, by its damping and the number of its elements.",
    "drift_steps": "Largest change of energy / of angular momentum in ten minutes, worst of all starts.",
    "step_errors": "Tip after a second of random torques, median / largest of 200 motions [mm], by steps in a period.",
    "coriolis_amplitudes": "The paper's forces by amplitude; the larger ones are not checked.",
}
PICTURES = Path("figures") / "validation"


@dataclass
class Options:
    """Regenerate the tables and pictures of docs/validation.md and docs/plant.md."""

    report: Path = Path("results/validation/report.xml")
    """Report of `make validate`; its pictures are in the folder `figures` beside it."""
    docs: Path = DOCS
    """The folder to bring up to date."""
    part: bool = False
    """Renew what the report holds; the rest stays as recorded."""


def read(report: Path) -> dict[str, Any]:
    """Return what a report holds: checks, and quoted figures and tables by group."""
    groups: dict[str, Any] = {name: {"title": title, "quoted": {}, "tables": {}} for name, title in GROUPS.items()}
    checks = []
    # by files: of which process the tests of a file are decides where they stand in the report
    for case in sorted(ET.parse(report).iter("testcase"), key=lambda case: case.attrib["classname"]):
        group = case.attrib["classname"].removeprefix("tests.validation.").partition(".")[0].removeprefix("test_")
        for entry in case.iter("property"):
            value = json.loads(entry.attrib["value"])
            if entry.attrib["name"] == "check":
                checks.append({"group": group, **value})
            else:
                groups[group][{"quoted": "quoted", "table": "tables"}[entry.attrib["name"]]] |= value
    return {"groups": groups, "checks": sorted(checks, key=lambda check: [*GROUPS].index(check["group"]))}


def renewed(record: dict[str, Any], found: dict[str, Any]) -> dict[str, Any]:
    """Return a record with what a newer report holds."""
    checks = {(check["group"], check["name"]): check for check in (*record["checks"], *found["checks"])}
    groups = {
        name: new | {what: record["groups"][name][what] | new[what] for what in ("quoted", "tables")}
        for name, new in found["groups"].items()
    }
    return {"groups": groups, "checks": sorted(checks.values(), key=lambda check: [*GROUPS].index(check["group"]))}


def tables_of(record: dict[str, Any]) -> dict[str, str]:
    """Return the tables of a record as Markdown, by their blocks' names."""
    return {name: text for group in record["groups"].values() for name, text in group["tables"].items()}


def figures_of(record: dict[str, Any]) -> dict[str, Any]:
    """Return the figures that pages quote from a record: what the expressions before them may use.

    Returns:
        The quoted figures of each group of checks, by the group's name; `orders`: of the energy's drift by the step;
        `span`; `engine` takes a pattern, too: `engines("doublet, linear, {} modes, rms", 2, 3)`; `checks`: how many;
        `planned`: distance from the chain under gentle feedback along the plan [mm].
    """
    quoted = {name: group["quoted"] for name, group in record["groups"].items()}
    engine = quoted["engine"]

    def engines(pattern: str, *parts: object) -> list[float]:
        return [engine[pattern.format(part)] for part in parts]

    def planned(lap: str, model: str, what: str = "rms") -> str:
        return f"{quoted['plant'][f'{lap}, plan with gentle feedback, {model}, {what}']:.1f}"

    return {
        **quoted,
        "engines": engines,
        "orders": [check["figure"] for check in record["checks"] if "that furthest from 5" in check["name"]],
        "planned": planned,
        "checks": len(record["checks"]),
        "span": span,
    }


def page_of(record: dict[str, Any]) -> str:
    """Return the page of all checks, and of the tables that only the record has."""
    parts = ["# The physics: all checks and tables\n\nWhich figure has each check, against which threshold, and why?\n"]
    for name, group in record["groups"].items():
        checks = [check for check in record["checks"] if check["group"] == name]
        rows = [[c["name"], *_figures(c), c["reason"], "passed" if c["passed"] else "**failed**"] for c in checks]
        parts += [f"## {group['title']}\n", table(("check", "figure", "threshold", "why this threshold", ""), rows)]
        parts += [f"{CAPTIONS[one]}\n\n{text}" for one, text in group["tables"].items() if one in CAPTIONS]
    return "\n".join(parts)


def _figures(check: dict[str, Any]) -> tuple[str, str]:
    """Write a check's figure and its threshold."""
    least, most = (None if check[name] is None else f"{check[name]:.3g}" for name in ("least", "most"))
    bounds = f"<= {most}" if least is None else f">= {least}" if most is None else f"{least} to {most}"
    unit = f" {check['unit']}" if check["unit"] else ""
    return f"{check['figure']:.3g}{unit}", f"{bounds}{unit}"


def main() -> None:
    """Command line."""
    options = read_options("python -m scripts.docs.validation", Options())
    if not options.report.exists():
        sys.exit(f"error: report = {options.report}: there is none; run `make validate` first")
    found = read(options.report)
    missing = {*GROUPS} - {check["group"] for check in found["checks"]}
    if missing and not options.part:
        sys.exit(f"error: report = {options.report}: lacks {', '.join(sorted(missing))}; --part renews the rest")
    if options.part:
        found = renewed(json.loads((options.docs / RECORD).read_text()), found)
    if failed := [check["name"] for check in found["checks"] if not check["passed"]]:
        sys.exit(f"error: report = {options.report}: checks failed: {'; '.join(failed)}")
    tables, figures = tables_of(found), figures_of(found)
    for name in (*PAGES, *QUOTING_PAGES):
        page = options.docs / name
        page.write_text(quoting(filled(page.read_text(), tables), figures))
    write_json(options.docs / RECORD, found)
    (options.report.parent / "tables.md").write_text(page_of(found))
    pictures = sorted((options.report.parent / "figures").glob("*.png"))
    for picture in pictures:
        shutil.copyfile(picture, options.docs / PICTURES / picture.name)
    print(f"{', '.join((*PAGES, *QUOTING_PAGES, RECORD))} and {len(pictures)} pictures up to date")


if __name__ == "__main__":
    run(main)
