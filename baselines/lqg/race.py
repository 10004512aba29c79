"""`RaceLQG`: a race by a plan of the whole race, with `LQG` along it and the plan's speeds of the reference.

The plan is made beforehand (`scripts.optimise.race`); progress along the path is then a function of time, and the race
is the tracking of a timed reference.
"""

from __future__ import annotations

from typing import Any, ClassVar, Self

import numpy as np

from flexarm_baselines.arrays import Array, Floats
from flexarm_baselines.controller import Seen
from flexarm_baselines.lqg.controller import LQG
from flexarm_baselines.observers import SENSORS
from flexarm_baselines.optimal.library import SAME
from flexarm_baselines.optimal.plan import PLANS, Plan
from flexarm_baselines.policy import env_attribute
from flexarm_baselines.task import Task
from flexarm_env.parameters import DIRECTIONS
from flexarm_env.physics.paths import ReferencePath
from flexarm_env.validation import choice

RACES = PLANS / "races"  # a plan's note "ways" has how far the reference is at each instant [m]
RACING: dict[str, Any] = {"action_mode": "race", "start": "corner"}  # options of the environments


class RaceLQG(LQG):
    """`LQG` along the plan of a race; its third action is the speed at which the plan's reference moves.

    Attributes:
        shares: that speed in each control period, as a share of the largest. Shape (n,).
    """

    blocks: ClassVar[tuple[str, ...]] = (*SENSORS, "time")
    shares: Array

    @classmethod
    def options(cls) -> dict[str, Any]:
        """Return the options with which an environment gives the controller what it reads."""
        return super().options() | RACING

    @classmethod
    def for_env(cls, env: Any, plan: Plan | None = None, **design: Any) -> Self:
        """Make the controller for a race, single or vector.

        Args:
            env: environment that was made with `options()`.
            plan: of the race, with the note "ways"; None: the one that comes with the package.
            **design: see `LQG`.

        Raises:
            ValueError: if it is no race of the plan's arm along its path, at its control period, within its torques, or
                the plan is of no race.
        """
        plan, settings = race_plan() if plan is None else plan, env_attribute(env, "settings")
        if "ways" not in plan.notes:
            raise ValueError('plan: must be of a race, with the note "ways"')
        time = plan.period * np.arange(len(plan.states))
        task = Task.of(env, ReferencePath(np.column_stack([time, plan.reference])))
        path, ways = settings.paths[DIRECTIONS.index(settings.direction)], np.asarray(plan.notes["ways"])
        same = plan.parameters == task.arm and np.allclose(plan.limits, task.torque_limit)
        if not same or np.abs(path.position(ways) - plan.reference).max() > SAME:
            raise ValueError("env: must be a race of the plan's arm, within its torques, along its path")
        found = cls(task, [plan], **design)
        found.shares = np.diff(ways) / (plan.period * settings.reference_speed)
        return found

    def period_of(self, seen: Seen) -> Array:
        """Return the control period of the race that begins; beyond the plan its last one. Shape (n,)."""
        period = np.round(np.nan_to_num(seen["time"][:, 0]) / self.task.period)
        return np.minimum(period, len(self.plans[0].torques) - 1).astype(np.int64)

    def action(self, seen: Seen, torque: Floats) -> Floats:
        """Return the torques as an action, and the speed of the plan's reference; see `TorqueController.action`."""
        return np.column_stack([super().action(seen, torque), self.shares[self.period_of(seen)]])


def race_plan(name: str = "default") -> Plan:
    """Load a plan of a race that comes with the package."""
    return Plan.load(RACES / f"{choice('name', name, sorted(path.stem for path in RACES.glob('*.npz')))}.npz")
