"""Runs -> plain numbers: what the claims, tables and sweeps are decided from."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexarm_env import SquareParameters, Trajectory, square
from flexarm_env.metrics import circle_fit, overshoot, path_difference, summary, tip_acceleration, vibration

SWITCHES = ("top left", "top right", "bottom right")  # direction switches within a lap


def measures(run: Trajectory, lap_time: float) -> dict[str, Any]:
    """Figures of one run; lengths in m, rates in m/s.

    Besides `flexarm_env.metrics.summary`: the overshoot past each switch of the rigid-kinematics tip (the one that
    the paper plots) and of the true tip, from the switch until the next one; the vibration over each side; the
    acceleration of the rigid tip; the circle through its path.
    """
    table = square(SquareParameters(lap_time=lap_time)).table
    figures: dict[str, Any] = dict(summary(run))
    for tip, path in (("rigid", run.rigid_tip), ("true", run.tip)):
        figures[f"{tip}_overshoot"] = [
            overshoot(path, run.time, table[k, 1:], table[k, 1:] - table[k - 1, 1:], (table[k, 0], table[k + 1, 0]))
            if run.time[-1] >= table[k, 0]
            else float("nan")
            for k in (1, 2, 3)
        ]
    figures["vibration_by_side"] = [vibration(run, *window) for window in _sides(run, lap_time)]
    figures["tip_acceleration"] = tip_acceleration(run) if len(run) > 2 else float("nan")
    fit = circle_fit(run.rigid_tip)
    figures["circle_radius"], figures["circle_deviation"] = fit.radius, fit.deviation
    return figures


def _sides(run: Trajectory, lap_time: float) -> list[tuple[float, float]]:
    """Start and end of each side that the run completes [s]."""
    ends = [0.25 * lap_time * k for k in range(1, 5)]
    return [(end - 0.25 * lap_time, end) for end in ends if run.time[-1] >= end - 1e-9]


def differences(runs: dict[str, Trajectory], lap_time: float) -> dict[str, dict[str, float]]:
    """Path differences (rigid tip, whatever the time, r.m.s. in m) between the sensings of one column.

    Keys are `<controller>_<place>_nmp` (NMP from collocated) and `<controller>_<place>_corrected` (corrected from
    NMP); values `all`, `top_right` (from a quarter of a side before the second switch to three quarters after), `rest`.
    """
    found: dict[str, dict[str, float]] = {}
    side = 0.25 * lap_time
    for name, run in runs.items():
        controller, sensing, place = name.split("_")
        other = {"nmp": "collocated", "corrected": "nmp"}.get(sensing)
        against = runs.get(f"{controller}_{other}_{place}")
        if against is None:
            continue
        distance = path_difference(run.rigid_tip, against.rigid_tip)
        near = (run.time > 1.75 * side) & (run.time < 2.75 * side)
        found[f"{controller}_{place}_{sensing}"] = {
            "all": _rms(distance),
            "top_right": _rms(distance[near]),
            "rest": _rms(distance[~near]),
        }
    return found


def _rms(values: Any) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if len(values) else float("nan")
