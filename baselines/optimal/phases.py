"""Plans for laps on which the payload changes: one problem for each stretch without a change, one after the other."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal.laps import OPTIONS
from flexarm_baselines.optimal.plan import Plan
from flexarm_baselines.optimal.problem import TrackingProblem
from flexarm_baselines.optimal.solver import SolverOptions, optimise
from flexarm_baselines.optimal.starts import Branch, along
from flexarm_env.parameters import ArmParameters
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.limits import rest_state
from flexarm_env.validation import finite_array

ITERATIONS = 60  # at most of each stretch; where the reference is smooth ten are enough


def plan_phases(
    arm: ArmParameters,
    reference: Floats,
    payloads: Floats,
    side: str,
    period: float = 0.01,
    limits: tuple[float, float] = (150.0, 50.0),
) -> Plan:
    """Plan a lap from rest on which the payload changes.

    Each stretch begins in the state in which the one before ends: the mass arrives with the tip's velocity. A stretch
    does not prepare for those after it, so that changes should fall into rests.

    Args:
        arm: the arm, with the payload of the stretches whose own is NaN.
        reference: where the tip should be at each instant [m]. Shape (n + 1, 2).
        payloads: see `Plan.payloads`. Shape (n,).
        side: side of the elbow, "positive" or "negative".
        period: control period [s].
        limits: largest torques of shoulder and elbow [N m].

    Raises:
        DivergingStartError: if a stretch diverges.
    """
    points, masses = finite_array("reference", reference, (None, 2)), np.asarray(payloads, dtype=np.float64)
    return _planned(arm, points.tobytes(), masses.tobytes(), side, period, limits)


@lru_cache(maxsize=8)
def _planned(
    arm: ArmParameters, reference: bytes, payloads: bytes, side: str, period: float, limits: tuple[float, float]
) -> Plan:
    points, masses = np.frombuffer(reference).reshape(-1, 2), np.frombuffer(payloads)
    carried = np.where(np.isnan(masses), arm.payload_mass, masses)
    edges = [0, *(np.flatnonzero(np.diff(carried)) + 1).tolist(), len(carried)]
    state, before = rest_state(FlexibleArm(arm), points[0], side), (0.0, 0.0)
    states, torques, residuals = [state[None]], [], []
    for begin, end in pairwise(edges):
        made = FlexibleArm(replace(arm, payload_mass=float(carried[begin])))
        own = OPTIONS | {"limits": limits, "period": period, "torque_before": before}
        problem = TrackingProblem(made, state, points[begin : end + 1], **own)
        found = optimise(problem, along(problem, [Branch(0.0, side)]), SolverOptions(ITERATIONS))
        states.append(found.run.states[1:])
        torques.append(found.run.torques)
        residuals.append(found.log[-1].residual)
        state, before = found.run.states[-1], tuple(found.run.torques[-1].tolist())
    notes = {"residuals": residuals}
    parts = np.concatenate(states), np.concatenate(torques), points
    return Plan(arm, *parts, limits, period, problem.step, notes, masses)
