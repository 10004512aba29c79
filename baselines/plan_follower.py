"""The privileged yardstick: the best plan known, with linear-quadratic feedback of the true state."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np

from flexarm_baselines.along_plans import PlanController, within_half_a_turn
from flexarm_baselines.arrays import Floats, product
from flexarm_baselines.controller import Memory, Seen
from flexarm_baselines.optimal.linear_quadratic import GOOD, RegulatorWeights
from flexarm_baselines.optimal.plan import Plan
from flexarm_baselines.optimal.tracking import PlanRegulator
from flexarm_baselines.task import Task


class PlanFollower(PlanController):
    """Track the best plan known by a time-varying linear-quadratic regulator of the true state.

    It observes the block `state`, which no sensor delivers: a privileged controller, to compare others with. Of the
    plans for its task, each arm follows the one whose joint angles are nearest to its own when its episode begins.
    """

    blocks: ClassVar[tuple[str, ...]] = ("state", "lap_phase")

    def __init__(self, task: Task, plans: Sequence[Plan] | None = None, weights: RegulatorWeights = GOOD) -> None:
        """Design the regulators.

        Args:
            task: see `Task`.
            plans: plans along the task's reference; None: those that come with the package.
            weights: weights of the regulators.

        Raises:
            ValueError: see `PlanController`.
        """
        super().__init__(task, plans)
        self.check_modes(task.arm)
        self._states = np.stack([plan.states for plan in self.plans])
        self._torques = np.stack([plan.torques for plan in self.plans])
        self._gains = np.stack([PlanRegulator(plan, weights).gains for plan in self.plans])

    def start(self, seen: Seen) -> Memory:
        """Choose each arm's plan."""
        return (self.nearest(self._state(seen)[:, :2], self.period_of(seen)),)

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Return the plan's torques with feedback; see `TorqueController.torque`."""
        (chosen,) = memory
        at = chosen, self.period_of(seen)
        off = within_half_a_turn(self._state(seen) - self._states[at])
        return self._torques[at] + product(self._gains[at], off), memory

    def _state(self, seen: Seen) -> Floats:
        """Return the arms' states. Shape (n, 4 + 4 m)."""
        return seen["state"]
