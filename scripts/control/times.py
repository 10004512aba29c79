"""Time how long controllers compute in a control period, on one arm: `python -m scripts.control.times`.

Times are those of this process alone on one processor core (`time.process_time`), so that other work on the machine
counts little. They are no part of a score.
"""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tyro

from flexarm_agents.contenders import ENVIRONMENT, from_controller
from flexarm_baselines.arrays import Floats
from flexarm_baselines.registry import controller_names
from flexarm_env.rollout import run_policy
from flexarm_env.validation import choice, integer
from scripts.common.command_line import run
from scripts.common.markdown import table
from scripts.common.result_files import write_whole

WARM_UP = 5  # calls that are not counted: kernels are loaded


@dataclass
class Options:
    """Time how long controllers compute in a control period."""

    output: Path = Path("results/control")
    """Folder for the table."""
    controllers: tuple[str, ...] = tuple(name for name in controller_names() if name.startswith(("lqg", "nmpc")))
    """Names of controllers."""
    periods: int = 1600
    """Control periods of the plain lap."""


class Timed:
    """A policy whose calls are timed."""

    def __init__(self, policy: Any) -> None:
        """Wrap a policy."""
        self.policy, self.times = policy, list[float]()

    def predict(self, *arguments: Any, **options: Any) -> Any:
        """See `Policy.predict`."""
        begun = time.process_time()
        found = self.policy.predict(*arguments, **options)
        self.times.append(time.process_time() - begun)
        return found


def times_of(name: str, periods: int) -> Floats:
    """Return how long a controller computes in each period of the plain lap [s]."""
    contender = from_controller(name, ENVIRONMENT, {})
    policy = Timed(contender.policy)
    try:
        run_policy(contender.env, policy, lap="plain", max_steps=periods)
    finally:
        contender.env.close()
    return np.array(policy.times[WARM_UP:])


def main() -> None:
    """Command line."""
    options = tyro.cli(Options, prog="python -m scripts.control.times")
    integer("periods", options.periods, WARM_UP + 1)
    for name in options.controllers:
        choice("controllers", name, controller_names())
    lines = []
    for name in options.controllers:
        found = 1e3 * times_of(name, options.periods)
        lines.append([f"`{name}`", *(f"{value:.2f}" for value in (np.median(found), *np.percentile(found, [99, 100])))])
    text = table(["controller", "median [ms]", "99th percentile [ms]", "longest [ms]"], lines)
    options.output.mkdir(parents=True, exist_ok=True)
    write_whole(options.output / "computing_times.md", lambda path: path.write_text(text))
    print(text)


if __name__ == "__main__":
    run(main)
