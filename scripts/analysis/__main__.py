"""Linear control theory of the arm: zeros against the sensor's position, passivity, margins of the paper's loop.

Writes `analysis.json`, Markdown tables, and `figures/` (PNG and SVG) to the output folder. docs/analysis.md tells the
story; `--docs` brings its tables and pictures up to date.
"""

from __future__ import annotations

import shutil
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tqdm import tqdm

from scripts.analysis import figures, margins, passivity, simulated, tables, zeros
from scripts.common.command_line import read_options, run
from scripts.common.markdown import DOCS, filled
from scripts.common.result_files import replacing, write_json

MARKER = "analysis.json"  # a complete result folder has it
PAGE = "analysis.md"
PICTURES = ("zeros_locus", "passivity", "margins")


@dataclass
class Options:
    """Poles, zeros, passivity and margins of the arm, with figures and JSON."""

    output: Path = Path("results/analysis")
    """Folder for the results; an existing one is replaced when the new one is complete."""
    quick: bool = False
    """For a look in seconds: coarser pictures, fewer models and poses, IFDC on the paper's arm, one simulated case."""
    docs: bool = False
    """Bring docs/analysis.md and its pictures up to date."""


def analyse(folder: Path, quick: bool) -> None:
    """Fill an empty folder.

    Args:
        folder: where.
        quick: see `Options`.
    """
    arms = list(margins.ARMS)[: 1 if quick else None]
    controllers = list(margins.GAINS)[-1:] if quick else list(margins.GAINS)
    cases = 2 * len(margins.SENSORS) * (len(arms) + 1) + 3 + (1 if quick else 12)
    with tqdm(total=cases, unit="study", desc="analysing") as bar:

        def tick() -> None:
            bar.update()

        results: dict[str, Any] = {"quick": quick, "zeros": zeros.study(quick)}
        tick()
        results["passivity"] = passivity.study(quick)
        tick()
        results["fuzzy_gains"] = margins.fuzzy_extremes()
        results["margins"] = margins.rows(arms, controllers, tick)
        results["room"] = margins.room(results["margins"])
        results["margins_by_modes"] = margins.by_modes((1, 2) if quick else (1, 2, 3, 4))
        results["profile"] = margins.profile(2 if quick else 9, controllers, tick)
        results["largest_gains"] = margins.largest_gains([] if quick else arms, (1,) if quick else (1, 2))
        tick()
        results["simulated"] = simulated.study(results["margins"], quick, tick)
    write_json(folder / MARKER, results)
    write_tables(folder, results)
    draw(folder, results)


def write_tables(folder: Path, results: dict[str, Any]) -> None:
    """Every table as Markdown."""
    texts = {
        "zeros_by_model": tables.zeros_by_model(results["zeros"]["by_model"]),
        "passivity": tables.passivity(results["passivity"]["rows"]),
        "margins": tables.margins(results["margins"], results["room"]),
        "margins_claim": tables.margins_claim(results["room"]),
        "margins_by_modes": tables.margins_by_modes(results["margins_by_modes"]),
        "simulated": tables.simulated(results["simulated"], results["margins"]),
        "largest_gains": tables.largest_gains(results["largest_gains"]),
    }
    for name, text in texts.items():
        (folder / f"{name}.md").write_text(text)


def draw(folder: Path, results: dict[str, Any]) -> None:
    """Every picture."""
    target = folder / "figures"
    target.mkdir()
    figures.zeros_locus(target, results["zeros"]["locus"])
    figures.passivity(target, results["passivity"])
    figures.margins(target, results["profile"], results["simulated"], results["margins"])


def update_docs(results: Path) -> None:
    """Fill the page's tables and copy its pictures."""
    page = DOCS / PAGE
    page.write_text(filled(page.read_text(), results))
    for name in PICTURES:
        shutil.copyfile(results / "figures" / f"{name}.png", DOCS / "figures" / f"{name}.png")
    print(f"{page}: tables and {len(PICTURES)} pictures up to date")


def main() -> None:
    """Command line."""
    options = read_options("python -m scripts.analysis", Options())
    if options.docs and options.quick:
        raise ValueError("docs = True: the page shows a full run, not a quick one")
    start = time.perf_counter()
    with replacing(options.output, MARKER) as work:
        analyse(work, options.quick)
    print(f"{options.output}: complete after {time.perf_counter() - start:.1f} s")
    if options.docs:
        update_docs(options.output)


if __name__ == "__main__":
    run(main)
