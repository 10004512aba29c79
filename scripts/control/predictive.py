"""What predictive control makes of arms and delays that are not as published, beside LQG and the true state."""

from __future__ import annotations

from functools import partial
from typing import Any

from scripts.control.parts import table_of, trials_of
from scripts.control.trials import Study

ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "NMPC": ("nmpc", {}),
    "NMPC, payload and stiffness estimated": ("nmpc_adaptive", {}),
    "NMPC, guide from the path alone": ("nmpc_path", {}),
    "NMPC of the true state": ("nmpc_state", {}),
    "NMPC, two iterations in a period": ("nmpc", {"iterations": 2}),
    "NMPC, horizon 0.2 s": ("nmpc", {"horizon": 0.2}),
    "NMPC, horizon 1 s": ("nmpc", {"horizon": 1.0}),
}

STUDY = Study(
    "predictive control: r.m.s. over the lap / after 2 s [m]",
    partial(trials_of, ROWS),
    partial(table_of, ROWS),
    "predictive.md",
)
