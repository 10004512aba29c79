"""Feedback along a plan: the time-varying linear-quadratic regulator of the arm's deviation from it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal.linear_quadratic import GOOD, LinearQuadratic, RegulatorWeights
from flexarm_baselines.optimal.plan import Plan
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.feedback import Rollout
from flexarm_env.validation import finite_rows, instance, number


class PlanRegulator:
    """Linear feedback along a plan: ``u = clip(u_plan + K (x - x_plan))``.

    Attributes:
        plan: the plan.
        weights: of the regulator.
        gains: K of each period [N m/x]. Shape (n, 2, 4 + 4 m).
    """

    def __init__(self, plan: Plan, weights: RegulatorWeights = GOOD, model: FlexibleArm | None = None) -> None:
        """Compute the gains.

        Args:
            plan: the plan.
            weights: see `RegulatorWeights`.
            model: arm that is linearised along the plan; None: the plan's.
        """
        instance("plan", plan, Plan)
        instance("weights", weights, RegulatorWeights)
        self.plan, self.weights = plan, weights
        arm = plan.arm if model is None else _fitting("model", plan, model)
        self.gains = LinearQuadratic.along(plan, weights, arm).gains()

    def torque(self, time: float, state: ArrayLike) -> Floats:
        """Return the torque at a time, of one arm or of many: that of the control period which it falls into.

        Before the plan's start its first period counts, after its end the last.

        Args:
            time: since the plan's start [s].
            state: Shape (..., 4 + 4 m).

        Returns:
            [N m], within the plan's limits. Shape (..., 2).
        """
        plan = self.plan
        states = finite_rows("state", state, plan.states.shape[1])
        period = int(np.floor(number("time", time, "s") / plan.period + 1e-9))
        period = min(max(period, 0), len(plan.torques) - 1)
        wanted = plan.torques[period] + (states - plan.states[period]) @ self.gains[period].T
        return np.clip(wanted, -np.array(plan.limits), plan.limits)

    def rollout(self, state: ArrayLike | None = None, arm: FlexibleArm | None = None, **quantities: Any) -> Rollout:
        """Run the whole plan under feedback of the true state, compiled; see `FlexibleArm.rollout`.

        Args:
            state: at the start; None: the plan's. Shape (..., 4 + 4 m).
            arm: that is run; None: the plan's.
            **quantities: payload_mass, stiffness, damping of what is run. Shape (...).
        """
        plan = self.plan
        run = plan.arm if arm is None else _fitting("arm", plan, arm)
        start = plan.states[0] if state is None else np.asarray(state, dtype=np.float64)
        return plan.rollout(run, start, plan.torques, gains=self.gains, references=plan.states[:-1], **quantities)


def _fitting(name: str, plan: Plan, arm: FlexibleArm) -> FlexibleArm:
    """Check that an arm has the plan's states."""
    instance(name, arm, FlexibleArm)
    if arm.parameters.modes_per_link != plan.parameters.modes_per_link:
        raise ValueError(
            f"{name}: has {arm.parameters.modes_per_link} modes a link, the plan's {plan.parameters.modes_per_link}"
        )
    return arm
