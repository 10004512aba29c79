"""The yardstick that knows everything: the best plan known, with linear-quadratic feedback of the true state."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from flexarm_baselines.arrays import Array, Floats
from flexarm_baselines.controller import Memory, Seen, TorqueController
from flexarm_baselines.joint_reference import nearest_turn
from flexarm_baselines.optimal.library import plans_for
from flexarm_baselines.optimal.plan import Plan
from flexarm_baselines.optimal.tracking import GOOD, PlanRegulator, RegulatorWeights
from flexarm_baselines.task import Task
from flexarm_env.validation import shown


class PlanFollower(TorqueController):
    """Track the best plan known by a time-varying linear-quadratic regulator of the true state.

    It observes the block `state`, which no sensor delivers: a privileged controller, to compare others with. Of the
    plans for its task, each arm follows the one whose joint angles are nearest to its own when its episode begins.

    Attributes:
        plans: plans along the task's reference.
    """

    blocks: ClassVar[tuple[str, ...]] = ("state", "lap_phase")

    def __init__(self, task: Task, plans: Sequence[Plan] | None = None, weights: RegulatorWeights = GOOD) -> None:
        """Design the regulators.

        Args:
            task: see `Task`.
            plans: plans along the task's reference; None: those that come with the package.
            weights: weights of the regulators.

        Raises:
            ValueError: if there is no plan, or one does not fit the task.
        """
        super().__init__(task)
        reference = task.reference
        if plans is None:
            plans = [plan for _, plan in plans_for(task.arm, reference, task.period, task.torque_limit)]
            if not plans:
                raise ValueError(
                    "env: the package has no plan for this arm, reference, control period and torque limit; make one "
                    "(docs/optimal.md) and give it as plans"
                )
        for n, plan in enumerate(plans):
            if plan.reference.shape != reference.shape or plan.period != task.period:
                raise ValueError(
                    f"plans[{n}]: must have {task.periods} periods of {task.period} s, has {len(plan.torques)} of "
                    f"{plan.period} s"
                )
        if not plans:
            raise ValueError(f"plans = {shown(plans)}: must hold one at least")
        self.plans = tuple(plans)
        self._states = np.stack([plan.states for plan in plans])
        self._torques = np.stack([plan.torques for plan in plans])
        self._gains = np.stack([PlanRegulator(plan, weights).gains for plan in plans])

    def start(self, seen: Seen) -> Memory:
        """Choose each arm's plan, and the turn of theta1 in which it counts."""
        off = self._states[:, self._period(seen), :2] - seen["state"][:, :2]  # (plans, n, 2)
        off[..., 0] -= nearest_turn(np.zeros(()), off[..., 0])
        chosen = np.argmin(np.sum(off**2, axis=-1), axis=0)
        return (chosen,)

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Return the plan's torques with feedback; see `TorqueController.torque`."""
        (chosen,) = memory
        period = self._period(seen)
        off = seen["state"] - self._states[chosen, period]
        off[:, 0] -= nearest_turn(np.zeros(()), off[:, 0])
        feedback = (self._gains[chosen, period] @ off[..., None])[..., 0]
        return self._torques[chosen, period] + feedback, memory

    def _period(self, seen: Seen) -> Array:
        """Return the control period of the lap that begins. Shape (n,)."""
        return np.round(seen.time / self.task.period).astype(np.int64)
