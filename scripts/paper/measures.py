"""Runs -> plain numbers: what the claims, tables and sweeps are decided from."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters, SquareParameters, Trajectory, square
from flexarm_env.metrics import (
    circle_fit,
    ended_early,
    overshoot,
    path_difference,
    summary,
    tip_acceleration,
    vibration,
)
from flexarm_env.metrics.window import rms

Array = NDArray[np.float64]
REACH = sum(ArmParameters.paper().link_lengths)  # of the stretched arm [m]
CORNER = SquareParameters.side / 2.0  # distance of the square's corners from either axis through the shoulder [m]
# The furthest that the rigid tip gets past a corner in the direction in which the reference came [m].
STRAIGHT_ON = float(np.sqrt(REACH**2 - CORNER**2) - CORNER)


def measures(run: Trajectory, lap_time: float) -> dict[str, Any]:
    """Measure one run; lengths in m, rates in m/s.

    Besides `flexarm_env.metrics.summary`: the overshoot past each switch of the rigid-kinematics tip (the one that
    the paper plots) and of the true tip, from the switch until the next one; the vibration over each side; the
    acceleration of the rigid tip; the circle through its path. As there, a run that ended early has no figures of
    merit, only overshoots and vibration of the sides that it completed.
    """
    table = square(SquareParameters(lap_time=lap_time)).table
    figures: dict[str, Any] = dict(summary(run))
    figures["rigid_overshoot_along"] = [_along(run, table[k - 1 : k + 2]) for k in (1, 2, 3)]
    for tip, path in (("rigid", run.rigid_tip), ("true", run.tip)):
        figures[f"{tip}_overshoot"] = [
            overshoot(path, run.time, table[k, 1:], table[k, 1:] - table[k - 1, 1:], (table[k, 0], table[k + 1, 0]))
            if run.time[-1] >= table[k + 1, 0] - 1e-9
            else float("nan")
            for k in (1, 2, 3)
        ]
    side, ends = 0.25 * lap_time, [0.25 * lap_time * k for k in range(1, 5)]
    figures["vibration_by_side"] = [vibration(run, end - side, end) for end in ends if run.time[-1] >= end - 1e-9]
    whole = not ended_early(run)
    fit = circle_fit(run.rigid_tip)
    figures["tip_acceleration"] = tip_acceleration(run) if whole else None
    figures["circle_radius"] = fit.radius if whole else None
    figures["circle_deviation"] = fit.deviation if whole else None
    return figures


def _along(run: Trajectory, knots: Array) -> float:
    """Return how far along the next side the rigid tip is where its overshoot is largest [m].

    Knots are time and place of the corner before, of the corner, and of the next. Shape (3, 3).
    """
    (_, before), (switch, corner), (end, after) = ((knot[0], knot[1:]) for knot in knots)
    inside = (run.time >= switch) & (run.time <= end)
    if run.time[-1] < end - 1e-9:
        return float("nan")
    from_corner = run.rigid_tip[inside] - corner
    peak = int(np.argmax(from_corner @ (corner - before)))
    side = after - corner
    return float(from_corner[peak] @ side / np.linalg.norm(side))


def least_along(overshoot: float) -> float:
    """Return how far along the next side a tip is at least that is so far past the corner [m]; 0 or more."""
    return max(0.0, float(CORNER - np.sqrt(REACH**2 - (CORNER + overshoot) ** 2)))


def differences(runs: dict[str, Trajectory], lap_time: float) -> dict[str, dict[str, float]]:
    """Measure path differences between the sensings of one column (rigid tip, whatever the time, r.m.s. in m).

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
            "all": rms(distance),
            "top_right": rms(distance[near]),
            "rest": rms(distance[~near]),
        }
    return found
