"""Compare controllers on the standard laps: tables, as Markdown and JSON; `--docs` puts them into their pages.

Each table is a module of this folder with a `STUDY`, and a line in `STUDIES`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import tyro
from tqdm import tqdm

from flexarm_agents.files import put
from flexarm_env.validation import choice, integer
from scripts.common.command_line import run
from scripts.common.markdown import DOCS, filled
from scripts.common.result_files import write_json
from scripts.control import feedback, joint, parts, predictive, registered, robust, shaping, unknown
from scripts.control.trials import Study, scores_of

STUDIES: dict[str, Study] = {
    "controllers": registered.STUDY,
    "joint_gains": joint.STUDY,
    "command_shaping": shaping.STUDY,
    "joint_feedback": feedback.STUDY,
    "lqg_parts": parts.STUDY,
    "lqg_unknown": unknown.STUDY,
    "lqg_robust": robust.STUDY,
    "predictive": predictive.STUDY,
}


@dataclass
class Options:
    """Compare controllers on the standard laps."""

    output: Path = Path("results/control")
    """Folder for the tables; those that are not made again stay."""
    tables: tuple[str, ...] = tuple(STUDIES)
    """Names of the tables to make."""
    jobs: int = 1
    """Processes."""
    quick: bool = False
    """A trial of the script: a few rows."""
    docs: bool = False
    """Bring the pages of these tables up to date with the folder, which must have all tables of a page."""


def main() -> None:
    """Command line.

    Raises:
        ValueError: for an unknown table, or a quick run for the docs.
    """
    options = tyro.cli(Options, prog="python -m scripts.control")
    integer("jobs", options.jobs, 1)
    for name in options.tables:
        choice("tables", name, tuple(STUDIES))
    if options.docs and options.quick:
        raise ValueError("docs = True: a quick run has no whole tables; must go without quick")
    options.output.mkdir(parents=True, exist_ok=True)
    for name in options.tables:
        make(name, options)
    if options.docs:
        for page in sorted({DOCS / STUDIES[name].page for name in options.tables}):
            page.write_text(filled(page.read_text(), options.output))
            print(f"{page}: tables up to date")


def make(name: str, options: Options) -> None:
    """Run a study, and write its table and its figures."""
    study = STUDIES[name]
    trials = study.trials(options.quick)
    with tqdm(total=len(trials), unit="trial", desc=name) as bar:
        scores = scores_of(trials, options.jobs, lambda label: bar.update())
    text = study.table(scores)
    write_json(options.output / f"{name}.json", {label: score.as_mapping() for label, score in scores.items()})
    put(options.output / f"{name}.md", lambda path: path.write_text(text))
    print(f"\n{study.text}:\n\n{text}")


if __name__ == "__main__":
    run(main)
