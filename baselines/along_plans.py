"""The base of controllers that follow plans for the laps of their task."""

from __future__ import annotations

from abc import ABC
from collections.abc import Sequence
from typing import get_args

import numpy as np

from flexarm_baselines.arrays import Array, Floats
from flexarm_baselines.controller import Seen, TorqueController
from flexarm_baselines.joint_space.reference import nearest_turn
from flexarm_baselines.optimal.library import SAME, SAME_PERIOD, plans_for
from flexarm_baselines.optimal.phases import plan_phases
from flexarm_baselines.optimal.plan import Plan
from flexarm_baselines.task import Task
from flexarm_env.parameters import ArmParameters, ElbowBranch
from flexarm_env.validation import shown


class PlanController(TorqueController, ABC):
    """A controller that has plans along its task's reference, one for each way in which an episode may begin.

    Attributes:
        plans: the plans.
    """

    def __init__(self, task: Task, plans: Sequence[Plan] | None = None) -> None:
        """Take plans that fit the task.

        Args:
            task: see `Task`.
            plans: plans along the task's reference; None: those that come with the package, or where the payload
                changes new ones (`plan_phases`).

        Raises:
            ValueError: if the task's motors are not ideal, there is no plan, or one has not the task's control periods
                or reference.
        """
        super().__init__(task)
        if task.motors:
            raise ValueError(
                f"env: {' and '.join(task.motors)}: {type(self).__name__} plans for ideal motors; to see what they "
                "cost it, give it dataclasses.replace(Task.of(env), motors=())"
            )
        reference = task.reference
        if plans is None:
            own = task.period, task.torque_limit
            if task.payloads is None:
                plans = [plan for _, plan in plans_for(task.arm, reference, *own)]
            else:
                sides = get_args(ElbowBranch)
                plans = [plan_phases(task.arm, reference, task.payloads, side, *own) for side in sides]
            if not plans:
                raise ValueError(
                    "env: the package has no plan for this arm, reference, control period and torque limit; make one "
                    "(docs/optimal.md) and give it as plans"
                )
        for n, plan in enumerate(plans):
            if plan.reference.shape != reference.shape or abs(plan.period - task.period) > SAME_PERIOD:
                raise ValueError(
                    f"plans[{n}]: must have {task.periods} periods of {task.period} s, has {len(plan.torques)} of "
                    f"{plan.period} s"
                )
            if (off := np.abs(plan.reference - reference)[:-1].max()) > SAME:  # a race ends elsewhere than it began
                raise ValueError(f"plans[{n}]: must be along the task's reference, its own is up to {off:.3g} m off")
        if not plans:
            raise ValueError(f"plans = {shown(plans)}: must hold one at least")
        self.plans = tuple(plans)

    def check_modes(self, arm: ArmParameters) -> None:
        """Check that the plans are of arms with as many modes as one.

        Raises:
            ValueError: if one is not.
        """
        for n, plan in enumerate(self.plans):
            if (modes := plan.parameters.modes_per_link) != arm.modes_per_link:
                raise ValueError(f"plans[{n}]: must have {arm.modes_per_link} modes of each link, has {modes}")

    def nearest(self, joints: Floats, period: Array) -> Array:
        """Choose the plans whose joint angles are nearest.

        Args:
            joints: theta1, theta2 [rad]. Shape (n, 2).
            period: control period of the lap. Shape (n,).

        Returns:
            Index of each arm's plan in `plans`. Shape (n,).
        """
        off = np.stack([plan.states[period, :2] for plan in self.plans]) - joints  # (plans, n, 2)
        return np.argmin(np.sum(within_half_a_turn(off) ** 2, axis=-1), axis=0)

    def period_of(self, seen: Seen) -> Array:
        """Return the control period of the lap that begins. Shape (n,)."""
        return seen.period


def within_half_a_turn(off: Floats) -> Floats:
    """Return differences without whole turns of their first entry, the angle theta1 [rad]. Shape (..., k)."""
    result = off.copy()
    result[..., 0] -= nearest_turn(np.zeros(()), off[..., 0])
    return result
