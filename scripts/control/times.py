"""Time how long controllers compute in a control period, on one arm: `python -m scripts.control.times`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from flexarm_agents.contenders import ENVIRONMENT, from_controller
from flexarm_agents.run_folder import put
from flexarm_baselines.registry import controller_names
from flexarm_env.validation import choice, integer
from scripts.common.command_line import run
from scripts.common.markdown import table
from scripts.common.period_times import FIRST, period_times


@dataclass
class Options:
    """Time how long controllers compute in a control period."""

    output: Path = Path("results/control")
    """Folder for the table."""
    controllers: tuple[str, ...] = tuple(name for name in controller_names() if name.startswith("nmpc"))
    """Names of controllers."""
    periods: int = 1600
    """Control periods of the plain lap."""


def main() -> None:
    """Command line."""
    options = tyro.cli(Options, prog="python -m scripts.control.times")
    integer("periods", options.periods, FIRST + 1)
    lines = []
    for name in options.controllers:
        contender = from_controller(choice("controllers", name, controller_names()), ENVIRONMENT, {})
        found = period_times(contender.env, contender.policy, options.periods)
        contender.env.close()
        figures = np.median(found), np.percentile(found, 99.0), np.max(found)
        lines.append([f"`{name}`", *(f"{value:.2f}" for value in figures)])
    text = table(["controller", "median [ms]", "99th percentile [ms]", "longest [ms]"], lines)
    options.output.mkdir(parents=True, exist_ok=True)
    put(options.output / "computing_times.md", lambda path: path.write_text(text))
    print(text)


if __name__ == "__main__":
    run(main)
