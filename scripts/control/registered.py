"""All controllers of the registry on the nominal plant: what each is, reads and scores."""

from __future__ import annotations

from flexarm_agents.evaluation.candidates import ENVIRONMENT, from_controller
from flexarm_baselines.registry import CONTROLLERS, controller_names
from scripts.common.markdown import table
from scripts.control.trials import ERRORS, Scores, Study, Trial, Trials, cell


def trials(quick: bool) -> Trials:
    """Return each controller as it is registered."""
    return {name: Trial(name) for name in controller_names()[: 1 if quick else None]}


def rows(scores: Scores) -> str:
    """Write the table."""
    lines = []
    for name, score in scores.items():
        one = from_controller(name, ENVIRONMENT, {})
        reads = ", ".join(f"**{what}**" if one.privileged and what == "true state" else what for what in one.reads)
        errors = (cell(lap, digits=1) for lap in (score.swing, score.plain))
        lines.append([f"`{name}`", CONTROLLERS[name].text, reads, *errors, CONTROLLERS[name].source])
        one.env.close()
    return table(["name", "controller", "reads", *ERRORS, "source"], lines)


STUDY = Study("all controllers of the registry, as they are", trials, rows)
