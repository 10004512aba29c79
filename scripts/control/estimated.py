"""Controllers that estimate the state: each part of LQG, and predictive control, on arms other than the published."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from flexarm_baselines.lqg import QUICK
from flexarm_baselines.observers import NoiseModel
from flexarm_baselines.optimal import GOOD
from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.common.study import Trial
from scripts.control.joint import drawn
from scripts.control.trials import cell, run_laps, study

Rows = Mapping[str, tuple[str, dict[str, Any]]]  # a controller and its design, by what the table calls it
LQG: Rows = {
    "LQG": ("lqg", {}),
    "delay ignored": ("lqg", {"delay": "ignored"}),
    "no feed-forward": ("lqg", {"feed_forward": False}),
    "with integral action": ("lqg", {"integral": 0.02}),
    "with strain gauges": ("lqg_gauges", {}),
    "quick filter, soft regulator": ("lqg", {"noise": QUICK, "weights": GOOD}),
    "filter of the true noise": ("lqg", {"noise": NoiseModel(joint_angle=1e-4, joint_rate=0.03, tip=3e-3)}),
    "adaptive LQG": ("lqg_adaptive", {}),
    "true state in place of a filter": ("plan_lqr", {}),
}
PREDICTIVE: Rows = {
    "NMPC": ("nmpc", {}),
    "adaptive NMPC": ("nmpc_adaptive", {}),
    "NMPC without an optimised plan": ("nmpc_path", {}),
    "NMPC of the true state": ("nmpc_state", {}),
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


def _trials(rows: Rows) -> dict[str, Trial]:
    return {
        f"{row}, {change}": partial(run_laps, name, design, {"noise": NOISE, **drawn(**own)}, OFF.get(change, ON))
        for row, (name, design) in rows.items()
        for change, own in CHANGES.items()
    }


def _table(rows: Rows, results: Any) -> str:
    """Tabulate rows, a line for each lap."""
    lines = [[row, lap, *(cell(results[f"{row}, {one}"][lap], 1) for one in CHANGES)] for row in rows for lap in LAPS]
    return table(["", "lap", *CHANGES], lines)


LQG_TEXT = "what each part of LQG is worth: r.m.s. over the lap / after 2 s [mm]"
PREDICTIVE_TEXT = "predictive control: r.m.s. over the lap / after 2 s [mm]"
STUDIES = {
    **study(__name__, "lqg_parts", LQG_TEXT, partial(_trials, LQG), partial(_table, LQG)),
    **study(__name__, "predictive", PREDICTIVE_TEXT, partial(_trials, PREDICTIVE), partial(_table, PREDICTIVE)),
}
