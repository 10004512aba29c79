"""What a corner costs: the plain lap with one thing changed at a time.

Nothing else is: each lap is optimised from the same kind of start, with the same solver and weights.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal import TrackingProblem, along, lap_problem, usual_starts
from flexarm_env.laps import SETTLED
from flexarm_env.metrics.window import rms
from flexarm_env.parameters import ArmParameters, SquareParameters
from flexarm_env.simulation.arm import FlexibleArm
from scripts.optimise.search import optimised

PATH = "corner"  # name of the study among the references
ITERATIONS = 300
BLEND = 0.4  # [s], over which a blended corner is a mean of the reference
STIFF = {"flexural_rigidities": (20.0 * 1676.0, 20.0 * 1676.0)}  # [N m^2]
LINEAR = {"kinematics": "linear"}
FINE = {"step": 5e-4}  # [s]; stiff links need shorter steps


@dataclass(frozen=True)
class Change:
    """A lap that differs from the plain one.

    Attributes:
        text: what differs.
        arm: fields of `ArmParameters`.
        problem: arguments of `lap_problem`.
        side: of the square [m]; the speed along it stays.
        blend: corners are blended, and the tip is judged against that.
    """

    text: str
    arm: dict[str, Any] = field(default_factory=dict)
    problem: dict[str, Any] = field(default_factory=dict)
    side: float = SquareParameters.side
    blend: bool = False


def _torques(factor: float) -> dict[str, Any]:
    return {"limits": (factor * 150.0, factor * 50.0), "deflection_limit": None}


CHANGES = (
    Change("nothing"),
    Change("torques held for 20 ms", problem={"period": 2e-2}),
    Change("links 20 times as stiff", STIFF, FINE),
    Change("torques twice as large, no limit of the deflections", problem=_torques(2.0)),
    Change("side of 12 m (12.6 m)", side=12.0),
    Change("side of 11 m", side=11.0),
    Change("corners blended over 0.4 s", blend=True),
    Change("linear kinematics", LINEAR),
)


def changed_lap(change: Change) -> TrackingProblem:
    """Return the problem of a changed lap."""
    usual = SquareParameters()
    lap_time = round(usual.lap_time * change.side / usual.side, 2)  # [s], a whole number of control periods
    square = SquareParameters(side=change.side, lap_time=lap_time, elbow_branch="negative")
    problem = lap_problem(FlexibleArm(ArmParameters(**change.arm)), square, **change.problem)
    return replace(problem, reference=blended(problem)) if change.blend else problem


def blended(problem: TrackingProblem) -> Floats:
    """Return the reference as its mean over `BLEND` about each instant, but for start and end. Shape (n + 1, 2)."""
    half, begin = round(0.5 * BLEND / problem.period), round(SETTLED / problem.period)
    last, window = len(problem.reference) - half, np.full(2 * half + 1, 1.0 / (2 * half + 1))
    reference = problem.reference.copy()
    for axis in range(2):
        reference[begin:last, axis] = np.convolve(reference[begin - half :, axis], window, "valid")
    return reference


def best(change: Change) -> dict[str, Any]:
    """Optimise a changed lap.

    Returns:
        r.m.s. and largest error after 2 s, largest deflection of a link [m], residual of optimality.
    """
    problem = changed_lap(change)
    start = along(problem, usual_starts("plain")[0])
    found = optimised(problem, start, ITERATIONS, change.text)
    positions = found.run.states[:, : problem.arm.size]
    away = np.linalg.norm(problem.arm.tip(positions) - problem.reference, axis=1)[problem.time >= SETTLED]
    return {
        "change": change.text,
        "true_tip_rms_after_2s": rms(away),
        "true_tip_max_after_2s": float(away.max()),
        "peak_deflection": float(np.abs(problem.arm.tip_deflection(positions)).max()),
        "residual": found.log[-1].residual,
        "converged": found.converged,
    }
