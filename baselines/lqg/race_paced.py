"""Races on arms that differ from the model: the plan waits for the arm, and the reference goes with both.

Along a timed plan an arm that lags is driven round a corner which it has not reached. Here the plan's instant is a
state of the controller: it goes on at a *pace*, of which 1 is the plan's own, so that what is left of a deviation lies
across the path. `PacedLQG` and `PacedAdaptiveLQG` set the pace by the lag of the estimated tip.

Sources: Dahl and Nielsen, *Torque-limited path following by online trajectory time scaling*, IEEE Trans. Robotics and
Automation 6, 1990; Hauser and Hindman, *Maneuver regulation from trajectory tracking*, NOLCOS 1995.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from flexarm_baselines.along_plans import PlanController
from flexarm_baselines.arrays import Array, Floats
from flexarm_baselines.controller import Memory, Seen
from flexarm_baselines.lqg.adaptive import AdaptiveLQG
from flexarm_baselines.lqg.controller import LQG
from flexarm_baselines.lqg.race import RACING, RaceLQG, race_plan
from flexarm_baselines.observers import SENSORS
from flexarm_baselines.optimal.plan import Plan
from flexarm_baselines.policy import env_attribute

NEAR = 20  # periods before and after the plan's instant in which the nearest one to the tip is sought
CLOSER = 0.2  # share of the lag by which the pace changes
LEAST, MOST = 0.4, 1.2  # paces; a plan that stood still would not begin


class Placed(Seen):
    """What arms observe, and the instants of their plans. Shape (n,)."""

    instants: Floats


class Paced(PlanController):
    """A controller of races along a plan whose instant it moves itself, and with it the reference.

    Attributes:
        ways: how far the reference is at each instant of the plan [m]. Shape (N + 1,).
        speed: largest speed of the reference [m/s].
        change: largest change of the reference's speed in a control period [m/s].
    """

    blocks: ClassVar[tuple[str, ...]] = SENSORS
    ways: Floats
    speed: float
    change: float

    @classmethod
    def options(cls) -> dict[str, Any]:
        """Return the options with which an environment gives the controller what it reads."""
        return super().options() | RACING

    @classmethod
    def for_env(cls, env: Any, plan: Plan | str = "default", **design: Any) -> Self:
        """Make the controller for a race; see `RaceLQG.for_env`.

        Args:
            env: environment that was made with `options()`.
            plan: of the race, or the name of one that comes with the package.
            **design: what the constructor takes beside task and plans.
        """
        plan = race_plan(plan) if isinstance(plan, str) else plan
        found: Self = RaceLQG.for_env.__func__(cls, env, plan, **design)  # type: ignore[attr-defined]
        settings = env_attribute(env, "settings")
        found.ways = np.asarray(plan.notes["ways"])
        found.speed, found.change = settings.reference_speed, settings.reference_acceleration * plan.period
        return found

    def period_of(self, seen: Seen) -> Array:
        """Return the plan's period that is nearest to its instant, 0 at the start. Shape (n,)."""
        if not isinstance(seen, Placed):
            return np.zeros(len(seen), dtype=np.int64)
        return np.minimum(np.rint(seen.instants), len(self.ways) - 2).astype(np.int64)

    def action(self, seen: Seen, torque: Floats) -> Floats:
        """Return an action of torques and the speed of the reference as a share of the largest, Shape (n, 3)."""
        return np.column_stack([super().action(seen, torque[:, :2]), torque[:, 2]])

    def led(self, instants: Floats, way: Floats, speed: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the speed of the reference as a share of the largest, how far it then is [m], and its speed [m/s].

        Args:
            instants: where the plan is to be next, in control periods. Shape (n,).
            way: how far the reference is [m]. Shape (n,).
            speed: of the period that ends [m/s]. Shape (n,).
        """
        beyond = np.maximum(instants - (len(self.ways) - 1), 0.0) * (self.ways[-1] - self.ways[-2])
        wanted = np.interp(instants, np.arange(len(self.ways)), self.ways) + beyond
        share = ((wanted - way) / (self.task.period * self.speed)).clip(0.0, 1.0).astype(np.float32)
        speed = np.clip(share * self.speed, speed - self.change, speed + self.change)
        return share, way + self.task.period * speed, speed


class PacedLQG(Paced, LQG):
    """`LQG` along the plan of a race that waits for the tip.

    Its memory is that of the controller without a pace, then the plan's instant in periods, how far the reference is
    [m], and its speed [m/s]. Shape (n,) each.
    """

    @cached_property
    def tips(self) -> Floats:
        """Where the plan has the tip at each instant [m]. Shape (N + 1, 2)."""
        return self._tip(self.plans[0].states)

    def start(self, seen: Seen) -> Memory:
        """Begin the plan, with the reference at rest."""
        return (*super().start(seen), *np.zeros((3, len(seen))))

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Return torques and the speed of the reference as a share of the largest, Shape (n, 3), and the memory."""
        *own, instants, way, speed = memory
        placed = Placed(seen.task, seen.observations)
        placed.instants = instants
        torque, after = super().torque(placed, tuple(own))
        instants = instants + self.pace(instants, after)
        share, way, speed = self.led(instants, way, speed)
        return np.column_stack([torque, share]), (*after, instants, way, speed)

    def expected(self, after: Memory) -> Floats:
        """Return the estimate for the next instant, z of `FilterTables`, from the memory of it. Shape (n, d)."""
        return after[0]

    def pace(self, instants: Floats, after: Memory) -> Floats:
        """Return by how many periods the plan goes on: more where the tip is ahead, less where it lags. Shape (n,).

        Args:
            instants: the plans'. Shape (n,).
            after: the memory of the next instant.
        """
        tip = self._tip(self.expected(after))
        around = np.rint(instants)[:, None].astype(np.int64) + np.arange(-NEAR, NEAR + 1)
        around = around.clip(0, len(self.tips) - 1)
        nearest = np.argmin(np.sum((self.tips[around] - tip[:, None]) ** 2, axis=2), axis=1)
        lag = instants + 1.0 - around[np.arange(len(tip)), nearest]
        return np.clip(1.0 - CLOSER * lag, LEAST, MOST)

    def _tip(self, estimate: Floats) -> Floats:
        arm = self.plans[0].arm
        return arm.tip(estimate[:, : arm.size].astype(np.float64))


class PacedAdaptiveLQG(PacedLQG, AdaptiveLQG):
    """`AdaptiveLQG` at a pace."""

    def expected(self, after: Memory) -> Floats:
        """Return the estimate of the hypothesis that each arm goes by; see `AdaptiveLQG`. Shape (n, d)."""
        return after[0][np.arange(len(after[7])), after[7].astype(np.int64)]
