"""What the gains of command shaping trade: other arms against late motors."""

from __future__ import annotations

from typing import Any

from flexarm_baselines.joint_space.tracking import JointFeedback
from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.control.joint import slowest_decay
from scripts.control.trials import Scores, Study, Trial, Trials, cell

GAINS = {
    "stiffer": JointFeedback((103.0, 140.0), (106.0, 36.0), 0.07, 0.19),
    "as registered": JointFeedback(),
    "softer": JointFeedback((7.0, 6.0), (36.0, 3.3), 0.2, 0.5),
}


def _drawn(**quantities: float) -> dict[str, Any]:
    """Return options of a plant that differs from what is published."""
    return {"randomisation": {name: (value, value) for name, value in quantities.items()}}


CASES: dict[str, dict[str, Any]] = {
    "default arm": {},
    "motors 5 ms late": _drawn(actuation_delay=0.005),
    "motors 10 ms late": _drawn(actuation_delay=0.01),
    "payload 0.5 kg": _drawn(payload_mass=0.5),
}


def trials(quick: bool) -> Trials:
    """Return all gains in each case."""
    found = {
        f"{name}, {case}": Trial("shaped", {"feedback": feedback}, options)
        for name, feedback in GAINS.items()
        for case, options in CASES.items()
    }
    return dict(list(found.items())[:1]) if quick else found


def rows(scores: Scores) -> str:
    """Write the table, a line for each lap."""
    lines = []
    for name, feedback in GAINS.items():
        known = [case for case in CASES if f"{name}, {case}" in scores]
        values = [f"{a:g} / {b:g}" for a, b in (feedback.stiffness, feedback.resistance)]
        values.append(f"{feedback.angle_filter:g} / {feedback.rate_filter:g}")
        for lap in LAPS if known else ():
            cells = [cell(getattr(scores[f"{name}, {case}"], lap)) for case in known]
            lines.append([name, *values, f"{slowest_decay(feedback):.2f}", lap, *cells])
    head = ["gains", "stiffness [N m/rad]", "damping gain [N m s/rad]", "filters [s]", "slowest decay [1/s]", "lap"]
    return table([*head, *list(CASES)[: len(lines[0]) - len(head)]], lines)


STUDY = Study("the gains of command shaping: r.m.s. over the lap / after 2 s [mm]", trials, rows, "controllers.md")
