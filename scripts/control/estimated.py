"""What each part of LQG is worth, on the default arm and on arms that differ from it."""

from functools import partial
from typing import Any

from flexarm_baselines.lqg import QUICK
from flexarm_baselines.optimal import GOOD
from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.common.study import Trial, study
from scripts.control.trials import cell, drawn, run_laps

# Controllers and their designs, by what the table calls them
LQG: dict[str, tuple[str, dict[str, Any]]] = {
    "LQG": ("lqg", {}),
    "delay ignored": ("lqg", {"delay": "ignored"}),
    "quick filter, soft regulator": ("lqg", {"noise": QUICK, "weights": GOOD}),
    "adaptive LQG": ("lqg_adaptive", {}),
    "true state in place of a filter": ("plan_lqr", {}),
}
CHANGES: dict[str, dict[str, float]] = {
    "default arm": {},
    "start 0.02 rad off": {},
    "payload 0.5 kg": {"payload_mass": 0.5},
    "frequencies -10 %": {"stiffness": 0.81},
    "frequencies +10 %": {"stiffness": 1.21},
    "no delay": {"delay": 0.0},
    "delay 60 ms": {"delay": 0.06},
}
NOISE = 0.003  # [m]
OFF = {"start 0.02 rad off": (-0.02, 0.02)}  # of the first corner [rad]
ON = (0.0, 0.0)


def _trials() -> dict[str, Trial]:
    return {
        f"{row}, {change}": partial(run_laps, name, design, {"noise": NOISE, **drawn(**own)}, OFF.get(change, ON))
        for row, (name, design) in LQG.items()
        for change, own in CHANGES.items()
    }


def _table(results: Any) -> str:
    """Tabulate rows, a line for each lap."""
    lines = [[row, lap, *(cell(results[f"{row}, {one}"][lap], 1) for one in CHANGES)] for row in LQG for lap in LAPS]
    return table(["", "lap", *CHANGES], lines)


TEXT = "what each part of LQG is worth: r.m.s. over the lap / after 2 s [mm]"
STUDIES = study(__name__, "lqg_parts", TEXT, _trials, _table)
