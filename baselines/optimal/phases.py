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
    payloads: Floats | None,
    starts: Sequence[Sequence[Branch]],
    options: SolverOptions,
    periods_beyond: int = 0,
) -> Solution:
    """Optimise each stretch without a change of the payload, from the state and torque at the end of the one before.

    Args:
        problem: of the whole run, without `residuals`.
        payloads: see `Plan.payloads`. Shape (n,).
        starts: branches of the first stretch's starts, see `along`; the others keep the side on which the best ends.
        options: of each stretch.
        periods_beyond: control periods for which a stretch is planned beyond its end, where the reference goes on.

    Returns:
        The run of all stretches, with the gains and the logs of each; it converged if all did.

    Raises:
        DivergingStartError: if a stretch diverges.
    """
    own = problem.arm.parameters
    masses = np.full(problem.periods, np.nan) if payloads is None else payloads
    carried = np.where(np.isnan(masses), own.payload_mass, masses)
    states, torques, found = [problem.initial_state[None]], [np.array([problem.torque_before])], []
    for begin, end in pairwise([0, *(np.flatnonzero(np.diff(carried)) + 1).tolist(), len(carried)]):
        stretch = replace(
            problem,
            arm=FlexibleArm(replace(own, payload_mass=float(carried[begin]))),
            initial_state=states[-1][-1],
            reference=problem.reference[begin : end + periods_beyond + 1],
            tip_weights=np.asarray(problem.tip_weights)[begin : end + periods_beyond + 1],
            torque_before=tuple(torques[-1][-1].tolist()),
        )
        runs = [along(stretch, branches) for branches in starts]
        best = int(np.argmin([stretch.cost(run) for run in runs]))
        one = optimise(stretch, runs[best], options)
        starts = [[Branch(0.0, starts[best][-1].side)]]
        states.append(one.run.states[1 : end - begin + 1])
        torques.append(one.run.torques[: end - begin])
        found.append(one._replace(gains=one.gains[: end - begin]))
    run, gains = Rollout(np.concatenate(states), np.concatenate(torques[1:])), [one.gains for one in found]
    log = tuple(row for one in found for row in one.log)
    return Solution(run, np.concatenate(gains), log, all(one.converged for one in found))
