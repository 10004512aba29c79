"""Plans for laps on which the payload changes: one problem for each stretch without a change, one after the other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal.laps import OPTIONS
from flexarm_baselines.optimal.plan import Plan
from flexarm_baselines.optimal.problem import TrackingProblem
from flexarm_baselines.optimal.solver import Solution, SolverOptions, optimise
from flexarm_baselines.optimal.starts import Branch, along
from flexarm_env.parameters import ArmParameters
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.feedback import Rollout
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
    points, masses, made = np.frombuffer(reference).reshape(-1, 2), np.frombuffer(payloads), FlexibleArm(arm)
    problem = TrackingProblem(made, rest_state(made, points[0], side), points, limits, period=period, **OPTIONS)
    found = optimise_phases(problem, masses, [[Branch(0.0, side)]], SolverOptions(ITERATIONS))
    return replace(Plan.of(problem, found), payloads=masses)


def optimise_phases(
    problem: TrackingProblem,
    payloads: Floats,
    ways: Sequence[Sequence[Branch]],
    options: SolverOptions,
    beyond: int = 0,
) -> Solution:
    """Optimise each stretch without a change of the payload, from the state and torque at the end of the one before.

    Args:
        problem: of the whole run, with one weight at all instants.
        payloads: see `Plan.payloads`. Shape (n,).
        ways: sides of the elbow by time that are tried in the first stretch; the others keep the best one's last side.
        options: of each stretch.
        beyond: control periods for which a stretch is planned beyond its end, where the reference goes on.

    Returns:
        What the solver found for the last stretch, with the whole run.

    Raises:
        DivergingStartError: if a stretch diverges.
    """
    own = problem.arm.parameters
    carried = np.where(np.isnan(payloads), own.payload_mass, payloads)
    states, torques = [problem.initial_state[None]], [np.zeros((1, 2))]
    for begin, end in pairwise([0, *(np.flatnonzero(np.diff(carried)) + 1).tolist(), len(carried)]):
        stretch = replace(
            problem,
            arm=FlexibleArm(replace(own, payload_mass=float(carried[begin]))),
            initial_state=states[-1][-1],
            reference=problem.reference[begin : end + beyond + 1],
            tip_weights=1.0,
            torque_before=tuple(torques[-1][-1].tolist()),
        )
        runs = [along(stretch, way) for way in ways]
        best = int(np.argmin([stretch.cost(run) for run in runs]))
        found = optimise(stretch, runs[best], options)
        ways = [[Branch(0.0, ways[best][-1].side)]]
        states.append(found.run.states[1 : end - begin + 1])
        torques.append(found.run.torques[: end - begin])
    return found._replace(run=Rollout(np.concatenate(states), np.concatenate(torques[1:])))
