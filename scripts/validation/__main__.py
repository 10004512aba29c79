"""Check the physics: against exact beam theory, finite elements, an engine of other hands, and its own invariants.

Writes `summary.json`, `summary.md` (a table of all groups), a table and a folder of data for each group, and
`figures/` (PNG and SVG). A check that fails does not stop the others; the exit status is then 1. A run that was
interrupted goes on where it was: a group whose sources and settings are the same is not run again. A run of some groups
keeps those of the others in the summary that are up to date.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

from tqdm import tqdm

from scripts.common.command_line import read_options, run
from scripts.validation.groups import GROUPS
from scripts.validation.runner import Outcome, earlier_outcome, printed, run_group, write_report

NAMES = tuple(group.name for group in GROUPS)


@dataclass
class Options:
    """Check the physics: frequencies, invariants, integrators, and another engine's answers."""

    output: Path | None = None
    """Folder for the results; what is there and up to date is taken over. None: results/validation, or
    results/validation-quick for the short version."""
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
    options = read_options("python -m scripts.validation", Options())
    unknown = sorted(set(options.only) - set(NAMES))
    if unknown or not options.only:
        raise ValueError(f"only = {options.only}: must be one or more of {NAMES}")
    output = options.output or Path(f"results/validation{'-quick' if options.quick else ''}")
    for path in (output, *output.parents):
        if path.exists() and not path.is_dir():
            raise ValueError(f"output = {output}: {path} is a file; must be a folder, or a new one's name")
    output.mkdir(parents=True, exist_ok=True)
    outcomes = _outcomes(options, output)
    write_report(outcomes, options.quick, output)
    print(printed([outcome for outcome in outcomes if outcome.group.name in options.only]))
    failed = [o.group.name for o in outcomes if o.failed(options.quick)]
    count = sum(len(o.checks) for o in outcomes)
    verdict = f"FAILED in {', '.join(failed)}" if failed else "all passed"
    for what, names in (
        ("NOT RUN", [o.group.name for o in outcomes if o.missing]),
        ("left out", [name for name in NAMES if name not in [o.group.name for o in outcomes]]),
    ):
        verdict += f"; {what}: {', '.join(names)}" if names else ""
    print(f"\n{output}: {count} checks, {verdict}")
    sys.exit(1 if failed else 0)


def _outcomes(options: Options, output: Path) -> list[Outcome]:
    """Of the groups chosen, and of those others that lie in the folder and are up to date; in the groups' order."""
    outcomes: list[Outcome] = []
    with tqdm(total=len(options.only), unit="group") as bar:
        for group in GROUPS:
            if group.name not in options.only:
                earlier = earlier_outcome(group, options.quick, output)
                outcomes += [earlier] if earlier else []
                continue
            bar.set_description(group.name)
            outcomes.append(run_group(group, options.quick, output, options.fresh, bar.set_postfix_str))
            bar.update()
    return outcomes


if __name__ == "__main__":
    run(main)
