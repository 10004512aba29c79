"""Bring docs/reproduction.md and its pictures up to date from a complete `results/paper`."""

import json
import shutil
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from scripts.common.command_line import read_options, run
from scripts.common.markdown import DOCS, blocks, filled, kept_tables, quoting, span
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
    return quoting(filled(page, tables), figures_of(results))


def figures_of(results: Path) -> dict[str, Any]:
    """Return the figures that the page quotes: what the expressions before them may use.

    Returns:
        `claims`: how many have a verdict, or how many there are; `over` and `rms`: overshoot and r.m.s. error [m] of a
        run; `three`: a controller's overshoots by sensing; `swept`: a figure of a sweep's row; `mean_gain`:
        of a run; `modal`: span of IFDC's modal coordinates.
    """
    runs = json.loads((results / "summary.json").read_text())["runs"]
    rows = json.loads((results / "sweeps.json").read_text())
    verdicts = [claim["verdict"] for claim in json.loads((results / "claims.json").read_text())]

    def claims(verdict: str = "") -> int:
        return verdicts.count(verdict) if verdict else len(verdicts)

    def over(name: str, column: str = "paper") -> str:
        return f"{runs[column][name]['rigid_overshoot'][0]:.2f}"

    def rms(name: str, tip: str = "true") -> str:
        return f"{runs['paper'][name][f'{tip}_tip_rms']:.2f}"

    def three(controller: str) -> str:
        return " / ".join(over(f"{controller}_{sensing}_tip") for sensing in ("collocated", "nmp", "corrected"))

    def swept(sweep: str, value: object, key: str, sensing: str = "collocated", **other: str) -> str:
        wanted = {"sweep": sweep, "value": value, "sensing": sensing, "place": "tip"} | other
        (row,) = [row for row in rows if all(row[name] == one for name, one in wanted.items())]
        return f"{row[key][0] if isinstance(row[key], list) else row[key]:.2f}"

    def constant(gain: float, key: str, sensing: str = "collocated") -> str:
        return swept("constant_gain", gain, key, sensing)

    def of_run(key: str) -> Callable[..., str]:
        return lambda name: f"{runs['paper'][name][key]:.2f}"

    modal = [runs["paper"][f"ifdc_{sensing}_tip"]["peak_deflection"][0] / 0.2 for sensing in ("collocated", "nmp")]
    return {
        "claims": claims,
        "over": over,
        "rms": rms,
        "three": three,
        "swept": swept,
        "constant": constant,
        "mean_gain": of_run("mean_gain"),
        "vibration": of_run("vibration"),
        "modal": span(modal),
    }


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
