"""Compare controllers on the standard laps: a table for each question, with what was tried."""

from functools import partial
from typing import Any

from flexarm_agents.evaluation.candidates import ENVIRONMENT, from_controller
from flexarm_baselines.registry import CONTROLLERS
from scripts.common.command_line import run
from scripts.common.markdown import table
from scripts.common.study import Study, command, study
from scripts.control import estimated, filtered, horizon, repeated, robust
from scripts.control.trials import ERRORS, cell, run_laps


def registered_table(results: Any) -> str:
    """Tabulate all controllers of the registry: what each is, reads and scores."""
    lines = []
    for name, laps in results.items():
        one = from_controller(name, ENVIRONMENT, {})
        reads = ", ".join(f"**{what}**" if one.privileged and what == "true state" else what for what in one.reads)
        errors = (cell(lap, 1) for lap in laps.values())
        lines.append([f"`{name}`", CONTROLLERS[name].text, reads, *errors, CONTROLLERS[name].source])
        one.env.close()
    return table(["name", "controller", "reads", *ERRORS, "source"], lines)


STUDIES: dict[str, Study] = {
    **study(
        "scripts.control.trials",
        "registered",
        "all controllers of laps in the registry, as they are",
        lambda: {name: partial(run_laps, name) for name, one in CONTROLLERS.items() if one.environment == ENVIRONMENT},
        registered_table,
    ),
    **estimated.STUDIES,
    **robust.STUDIES,
    **repeated.STUDIES,
    **filtered.STUDIES,
    **horizon.STUDIES,
}


def main() -> None:
    """Command line."""
    command("control", STUDIES, "Compare controllers on the standard laps.")


if __name__ == "__main__":
    run(main)
