"""What a corner costs: the plain lap with one thing changed at a time.

Nothing else is: each lap is optimised from the same kind of start, with the same solver and weights.
"""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal import Plan, TrackingProblem, along, lap_problem, usual_starts
from flexarm_env.laps import SETTLED
from flexarm_env.metrics.window import rms
from flexarm_env.parameters import ArmParameters, SquareParameters
from flexarm_env.simulation.arm import FlexibleArm
from scripts.optimise.score import tip_errors
from scripts.optimise.search import optimised

PATH = "corner"  # name of the study among the references
ITERATIONS = 300
BLEND = 0.4  # [s], over which a blended corner is a mean of the reference
STIFF = {"flexural_rigidities": (20.0 * 1676.0, 20.0 * 1676.0)}  # [N m^2]
FINE = {"step": 5e-4}  # [s]; stiff links need shorter steps
STRONG = {"limits": (300.0, 100.0), "deflection_limit": None}  # [N m]


@dataclass(frozen=True)
class Change:
    """A lap that differs from the plain one."""

    text: str  # what differs
    arm: dict[str, Any] = field(default_factory=dict)  # fields of `ArmParameters`
    problem: dict[str, Any] = field(default_factory=dict)  # arguments of `lap_problem`
    side: float = SquareParameters.side  # of the square [m]; the speed along it stays
    blend: bool = False  # corners are blended, and the tip is judged against that


CHANGES = (
    Change("nothing"),
    Change("torques held for 20 ms", problem={"period": 2e-2}),
    Change("links 20 times as stiff", STIFF, FINE),
    Change("torques twice as large, no limit of the deflections", problem=STRONG),
    Change("side of 12 m (12.6 m)", side=12.0),
    Change("side of 11 m", side=11.0),
    Change("corners blended over 0.4 s", blend=True),
    Change("linear kinematics", {"kinematics": "linear"}),
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
    """Optimise a changed lap; return errors after 2 s, a link's largest deflection [m], the residual of optimality."""
    problem = changed_lap(change)
    found = optimised(problem, along(problem, usual_starts("plain")[0]), ITERATIONS, change.text)
    plan = Plan.of(problem, found)
    away = tip_errors(plan)[plan.time >= SETTLED]
    return {
        "change": change.text,
        "true_tip_rms_after_2s": rms(away),
        "true_tip_max_after_2s": float(away.max()),
        "peak_deflection": float(np.abs(plan.arm.tip_deflection(plan.states[:, : plan.arm.size])).max()),
        "residual": found.log[-1].residual,
        "converged": found.converged,
    }
