"""Predictive control on arms and delays that differ from what is published."""

from __future__ import annotations

from functools import partial
from typing import Any

from scripts.control.parts import table_of, trials_of
from scripts.control.trials import Study

ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "NMPC": ("nmpc", {}),
    "adaptive NMPC": ("nmpc_adaptive", {}),
    "NMPC without an optimised plan": ("nmpc_path", {}),
    "NMPC of the true state": ("nmpc_state", {}),
}

STUDY = Study(
    "predictive control: r.m.s. over the lap / after 2 s [mm]",
    partial(trials_of, ROWS),
    partial(table_of, ROWS),
    "predictive.md",
)
