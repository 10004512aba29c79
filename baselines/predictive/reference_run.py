"""What a prediction is tied to beyond its horizon: a run along the lap, and the cost of what follows each instant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from flexarm_baselines.arrays import Floats, prolonged
from flexarm_baselines.optimal.kernels import Model, Sweep
from flexarm_baselines.optimal.laps import DEFLECTION
from flexarm_baselines.optimal.plan import Plan
from flexarm_baselines.optimal.problem import DEFLECTION_WEIGHT, TrackingProblem
from flexarm_baselines.optimal.starts import SIDES, along, both_sides
from flexarm_baselines.optimal.sweep import sweep
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.limits import rest_state


@dataclass(frozen=True)
class ReferenceRun:
    """Runs along a lap of P periods, one for each way in which an episode may begin, and the costs of what follows.

    All are prolonged by a horizon beyond the lap's end, where nothing costs anything. l runs; n entries of a state.

    Attributes:
        states: at each instant. Shape (l, P + 1 + horizon, n).
        torques: of each period [N m]. Shape (l, P + 1 + horizon, 2).
        gains: feedback of state and torque before along the runs. Shape (l, P + 1 + horizon, 2, n + 2).
        slopes: of the cost from each instant on, by state and torque before. Shape (l, P + 1 + horizon, n + 2).
        curvatures: its curvature. Shape (l, P + 1 + horizon, n + 2, n + 2).
        reference: where the tip should be [m]. Shape (P + 1 + horizon, 2).
        tip_weights: of each instant [1]. Shape (P + 1 + horizon,).
        torque_weights: on squared torques, and on their squared changes [m^2/(N m)^2]. Shape (2, 2).
        deflection_weight: on squared deflections beyond `deflection_limit` [1].
        deflection_limit: [m].
    """

    states: Floats
    torques: Floats
    gains: Floats
    slopes: Floats
    curvatures: Floats
    reference: Floats
    tip_weights: Floats
    torque_weights: Floats
    deflection_weight: float
    deflection_limit: float

    @classmethod
    def along(
        cls,
        plans: Sequence[Plan],
        model: FlexibleArm,
        horizon: int,
        change_weight: float,
        deflection_limit: float = DEFLECTION,
    ) -> Self:
        """Sweep backward along plans of one reference.

        Args:
            plans: as long as each other.
            model: arm that is linearised along them.
            horizon: periods.
            change_weight: see `TrackingProblem` [m^2].
            deflection_limit: see there [m].
        """
        parts = []
        for plan in plans:
            problem = TrackingProblem(
                model,
                plan.states[0],
                plan.reference,
                plan.limits,
                change_weight=change_weight,
                deflection_limit=deflection_limit,
                period=plan.period,
                step=plan.step,
            )
            found = _swept(problem, plan)
            tables = prolonged(plan.states, horizon), prolonged(plan.torques, horizon + 1)
            faded = _faded(found.gains, horizon + 1), _faded(found.slopes, horizon), _faded(found.curvatures, horizon)
            parts.append((*tables, *faded))
        states, torques, gains, slopes, curvatures = (np.stack(part) for part in zip(*parts, strict=True))
        instants = len(problem.reference)
        return cls(
            states,
            torques,
            gains,
            slopes,
            curvatures,
            reference=prolonged(problem.reference, horizon),
            tip_weights=_faded(np.full(instants, 1.0 / instants), horizon),
            torque_weights=problem.weights,
            deflection_weight=DEFLECTION_WEIGHT / instants,
            deflection_limit=deflection_limit,
        )


def _swept(problem: TrackingProblem, plan: Plan) -> Sweep:
    found = problem.arm.step_jacobians(plan.states[:-1], plan.torques, problem.period, step=problem.step)
    torques, defects = problem.with_torque_before(plan.torques), found.state - plan.states[1:]
    model = Model(found.by_state, found.by_torque, *problem.expand(plan.states), torques, defects)
    return sweep(model, np.array(problem.limits))


def _faded(table: Floats, more: int) -> Floats:
    return np.concatenate([table, np.zeros((more, *table.shape[1:]))])


def previewed(arm: FlexibleArm, reference: Floats, limits: tuple[float, float], period: float) -> list[Plan]:
    """Make a run along a reference from rest on either side of the elbow, without optimising it.

    A preview controller follows rigid inverse kinematics on the side of the start, or on the other one at once; the
    better of the two is taken.

    Args:
        arm: the arm.
        reference: where the tip should be at each instant [m]. Shape (P + 1, 2).
        limits: largest torques of shoulder and elbow [N m].
        period: control period [s].
    """
    plans = []
    for side in SIDES:
        start = rest_state(arm, reference[0], side)
        problem = TrackingProblem(arm, start, reference, limits, deflection_limit=DEFLECTION, period=period)
        runs = [along(problem, way) for way in both_sides(side, period)]
        best = min(runs, key=lambda run: float(problem.cost(run)))
        plans.append(Plan(arm.parameters, *best, reference, limits, period, problem.step))
    return plans
