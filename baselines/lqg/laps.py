"""The laps of a task in the frame of the plans for them: a lap may be turned, or a mirror image."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Self

import numpy as np

from flexarm_baselines.arrays import Floats, Integers
from flexarm_baselines.observers import Readings
from flexarm_baselines.optimal import Plan, load_plan, plan_names
from flexarm_baselines.task import Task
from flexarm_env.parameters import ArmParameters
from flexarm_env.validation import choice

CLOSE = 1e-6  # [m]; the task's reference may be so far from the plans'


class Laps:
    """Plans for the laps of one task, and the map from the world into their frame.

    A lap from another corner is the same lap, turned about the shoulder; in the other direction it is the mirror image.

    Attributes:
        plans: one for each lap.
        names: of the laps.
        mirror: 1, or -1 if the task's laps are mirror images of the planned ones.
        turn: angle by which the laps are turned, after mirroring [rad].
    """

    def __init__(self, plans: Mapping[str, Plan], task: Task) -> None:
        """Find the map.

        Args:
            plans: by the laps' names.
            task: the task.

        Raises:
            ValueError: if the plans do not follow the task's reference, or have another control period.
        """
        if not plans:
            raise ValueError("plans: must hold one at least")
        self.names, self.plans = tuple(plans), tuple(plans.values())
        first = self.plans[0]
        for name, plan in plans.items():
            if plan.period != task.period or len(plan.torques) != task.periods:
                raise ValueError(
                    f"plans[{name!r}]: has {len(plan.torques)} periods of {plan.period} s, the task's lap "
                    f"{task.periods} of {task.period} s"
                )
            if plan.parameters.modes_per_link != first.parameters.modes_per_link:
                raise ValueError(f"plans[{name!r}]: must have as many modes a link as the others")
        wanted = task.path.position(np.minimum(first.time, task.lap_time))
        for mirror in (1.0, -1.0):
            self.mirror = mirror
            self.turn = _angle(wanted[0]) - mirror * _angle(first.reference[0])
            if all(np.abs(self.points(wanted) - plan.reference).max() < CLOSE for plan in self.plans):
                return
        raise ValueError("plans: must follow the task's reference, turned about the shoulder or mirrored")

    @classmethod
    def known(cls, task: Task) -> Self:
        """Take the plans of the two standard laps that come with the package.

        Raises:
            ValueError: if there are none for the task's arm.
        """
        presets = {name.rsplit("_", 1)[0] for name in plan_names()}
        for preset in sorted(presets):
            if ArmParameters.named(preset) == task.arm:
                return cls({lap: load_plan(f"{preset}_{lap}") for lap in ("swing", "plain")}, task)
        raise ValueError(
            f"plans: there are none for this arm (only for {', '.join(sorted(presets))}): give some, as "
            "flexarm_baselines.optimal.plan_lap makes them"
        )

    def __len__(self) -> int:
        """Return the number of laps."""
        return len(self.plans)

    def index(self, name: str) -> int:
        """Return the place of a lap.

        Raises:
            ValueError: for another name.
        """
        return self.names.index(choice("lap", name, self.names))

    def points(self, world: Floats) -> Floats:
        """Bring points into the plans' frame. Shape (..., 2)."""
        cos, sin = np.cos(self.turn), np.sin(self.turn)
        return np.asarray(world @ np.array([[cos, -self.mirror * sin], [sin, self.mirror * cos]]))

    def readings(self, world: Readings) -> Readings:
        """Bring readings into the plans' frame; theta1 within half a turn of 0."""
        joints = self.mirror * (world.joints - [self.turn, 0.0, 0.0, 0.0])
        joints[:, 0] = half_turn(joints[:, 0])
        gauges = None if world.gauges is None else self.mirror * world.gauges
        return Readings(joints, self.points(world.tip), gauges)

    def torques(self, planned: Floats) -> Floats:
        """Bring torques from the plans' frame into the world."""
        return self.mirror * planned

    def nearest(self, joints: Floats, period: Integers) -> Integers:
        """Choose laps by the joint angles with which arms begin.

        Args:
            joints: theta1, theta2 in the plans' frame [rad]. Shape (n, 2).
            period: control period of the lap. Shape (n,).

        Returns:
            Place of the lap of each arm. Shape (n,).
        """
        away = np.stack([half_turn(joints - plan.states[period, :2]) for plan in self.plans])
        return np.asarray(np.argmin(np.sum(away**2, axis=2), axis=0))


def half_turn(angle: Floats) -> Floats:
    """Return angles within half a turn of 0 [rad]."""
    return np.mod(angle + np.pi, 2.0 * np.pi) - np.pi


def _angle(point: Floats) -> float:
    return float(np.arctan2(point[1], point[0]))
