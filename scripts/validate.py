"""Check the physics: against exact beam theory, finite elements, an engine of other hands, and its own invariants.

Writes `summary.json`, `summary.md` (a table of all checks), a table and a folder of data for each group, and
`figures/` (PNG and SVG). A check that fails does not stop the others; the exit status is then 1. A run that was
interrupted goes on where it was: a group whose sources and settings are the same is not run again.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import tyro
from tqdm import tqdm

from command_line import run
from validation_parts.groups import GROUPS
from validation_parts.runner import Outcome, printed, run_group, write_report

NAMES = tuple(group.name for group in GROUPS)


@dataclass
class Options:
    """Check the physics: frequencies, invariants, integrators, and another engine's answers."""

    output: Path = Path("results/validation")
    """Folder for the results; what is there and up to date is taken over."""
    quick: bool = False
    """A short version, seconds a group, as the tests run it."""
    only: tuple[str, ...] = NAMES
    """Which groups."""
    fresh: bool = False
    """Run groups again that are up to date."""


def main() -> None:
    """Command line.

    Raises:
        ValueError: for a group that there is not, or an output that is no folder.
    """
    options = tyro.cli(Options)
    unknown = sorted(set(options.only) - set(NAMES))
    if unknown or not options.only:
        raise ValueError(f"only = {options.only}: must be one or more of {NAMES}")
    options.output.mkdir(parents=True, exist_ok=True)
    outcomes: list[Outcome] = []
    chosen = [group for group in GROUPS if group.name in options.only]
    with tqdm(total=len(chosen), unit="group") as bar:
        for group in chosen:
            bar.set_description(group.name)
            outcomes.append(run_group(group, options.quick, options.output, options.fresh, bar.set_postfix_str))
            bar.update()
    write_report(outcomes, options.quick, options.output)
    print(printed(outcomes))
    failed = [o.group.name for o in outcomes if o.failed(options.quick)]
    count = sum(len(o.checks) for o in outcomes)
    verdict = f"FAILED in {', '.join(failed)}" if failed else "all passed"
    not_run = [o.group.name for o in outcomes if o.missing]
    verdict += f"; NOT RUN: {', '.join(not_run)}" if not_run else ""
    print(f"\n{options.output}: {count} checks, {verdict}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    run(main)
