"""`LQG`: a plan, a time-varying regulator along it, and a Kalman filter on encoders and the late tip.

Sources: Anderson and Moore, *Optimal Control: Linear Quadratic Methods*, 1990, chapters 3 and 8 (regulator, filter, and
their separation); Anderson and Moore, *Optimal Filtering*, 1979, section 7.3 (late readings by augmentation); Doyle and
Stein, IEEE Trans. Automatic Control 26, 1981 (noise on the torques for robustness: loop transfer recovery); Ackermann,
IEEE Trans. Automatic Control 25, 1980 (one fixed design for a set of plants).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, Literal

import numpy as np

from flexarm_baselines.along_plans import PlanController
from flexarm_baselines.arrays import Floats, product
from flexarm_baselines.controller import Memory, Seen
from flexarm_baselines.lqg.tables import FilterTables, Place, RegulatorTables
from flexarm_baselines.observers import GAUGES, SENSORS, KalmanFilter, NoiseModel, fresh
from flexarm_baselines.optimal import LinearQuadratic, Plan, RegulatorWeights
from flexarm_baselines.task import Task
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import choice, number

# Encoders and gauges see vibrations of 70 Hz and more that no model integrates well, so that rates are trusted little.
# Noise on the torques, more than there is, gives loop transfer recovery. This filter is quick where the model is right.
QUICK = NoiseModel(
    joint_angle=3e-4, joint_rate=0.1, tip=0.01, gauge=0.02, gauge_rate=3.0, torque=(10.0, 4.0), modal_force=1e-3
)
# Of all that were compared, what lets deviations from the plan decay fastest on the slowest arm of `SquareUnknown-v0`
# (`python -m scripts.control --only lqg_robust` searches; docs/lqg.md).
NOISE = replace(QUICK, joint_angle=0.028, joint_rate=9.0)
WEIGHTS = RegulatorWeights(speed=0.05, torque=(8.0, 2.7))
DELAYS = ("known", "ignored")
TIP = slice(4, 6)  # of the readings


class LQG(PlanController):
    """Linear-quadratic-Gaussian control of the arm's deviation from a plan, from encoders and the late tip.

    It takes the plan that begins nearest to the joint angles that it reads first. All its matrices are computed
    beforehand; a control period takes a few products.

    Attributes:
        kalman: the filter that the tables are made of.
        filter: see `FilterTables`.
        regulator: see `RegulatorTables`.
        late: share of a control period after which torques act.
        integrates: whether it has integral action.
    """

    blocks: ClassVar[tuple[str, ...]] = (*SENSORS, "lap_phase")

    def __init__(
        self,
        task: Task,
        plans: Sequence[Plan] | None = None,
        model: FlexibleArm | None = None,
        weights: RegulatorWeights = WEIGHTS,
        noise: NoiseModel = NOISE,
        delay: Literal["known", "ignored"] | float = "known",
        feed_forward: bool = True,
        integral: float | None = None,
    ) -> None:
        """Design filter and regulator.

        Args:
            task: see `Task`.
            plans: see `PlanController`.
            model: arm that filter and regulator are designed for; None: the task's.
            weights: of the regulator.
            noise: standard deviations that the filter assumes.
            delay: "known": the task's; "ignored": the filter takes the late tip for the present one; or the delay that
                the filter assumes [s].
            feed_forward: whether the plan's torques act; without them feedback alone keeps the arm near the plan.
            integral: integral of the late tip's deviation that weighs as much as the deviations of the weights do
                [m s]; None: no integral action.

        Raises:
            ValueError: if torques act later than a control period, the late sensor does not read where its point is, or
                as in `PlanController`.
        """
        super().__init__(task, plans)
        task.check_true_point()
        arm = FlexibleArm(task.arm) if model is None else model
        self.check_modes(arm.parameters)
        if isinstance(delay, str):
            delay = task.delay if choice("delay", delay, DELAYS) == "known" else 0.0
        if integral is not None:
            number("integral", integral, "m s", above=0.0)
        self.kalman = KalmanFilter(arm, task.period, delay, task.sensor_position, noise)
        self.late = share_of_a_period(task)
        self.integrates = integral is not None
        self.filter = FilterTables.along(self.kalman, self.plans, "modal_coordinates" in self.blocks)
        problems = [LinearQuadratic.along(plan, weights, arm) for plan in self.plans]
        self.regulator = RegulatorTables.along(self.plans, problems, self.late, integral, feed_forward)

    def start(self, seen: Seen) -> Memory:
        """Begin on the nearest plan, with motors at rest."""
        chosen, period = self.nearest(seen["joint_angles"], self.period_of(seen)), self.period_of(seen)
        nothing = np.zeros((len(seen), 2))
        return self.filter.nominal[chosen, period], chosen, nothing, nothing, np.full_like(nothing, np.nan)

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Correct the estimate by the readings, command torques, and predict the next estimate."""
        estimate, chosen, before, integral, tip = memory
        at, tables = (chosen, self.period_of(seen)), self.filter
        readings = self._readings(seen, tip)
        estimate = estimate + product(tables.gain[at], tables.residual(estimate, readings))
        late = np.full((len(seen), 1), self.late)
        wanted, estimate = self._driven(at, estimate, before, late, integral)
        torque = self.limited(wanted)
        integral = integral + self.task.period * tables.residual(tables.nominal[at], readings)[:, TIP]
        after = tables.predict(at, estimate, before, torque, late)
        return torque, (after, chosen, torque, integral, seen["sensed_position"])

    def _driven(
        self, at: Place, estimate: Floats, before: Floats, late: Floats, integral: Floats
    ) -> tuple[Floats, Floats]:
        """Return torques without their limits [N m], Shape (n, 2), and the estimate from which prediction goes on."""
        off = (estimate - self.filter.nominal[at])[:, : self.filter.matrix.shape[-1]]
        return self.regulator.torques(at, off, before, late, integral[:, : 2 * self.integrates]), estimate

    def limited(self, torque: Floats) -> Floats:
        """Return torques within the motors' limits [N m]."""
        limit = np.asarray(self.task.torque_limit)
        return np.clip(torque, -limit, limit)

    def _readings(self, seen: Seen, before: Floats) -> Floats:
        """Return what the sensors read, in the order of `observers.Readings`; see `fresh`. Shape (n, r)."""
        tip = fresh(seen["sensed_position"], before)
        others = [seen[name] for name in GAUGES if name in self.blocks]
        return np.concatenate([seen["joint_angles"], seen["joint_rates"], tip, *others], axis=1)


def share_of_a_period(task: Task) -> float:
    """Return the share of a control period after which torques act.

    Raises:
        ValueError: if they act later than a control period.
    """
    late = task.actuation_delay / task.period
    if late > 1.0:
        raise ValueError(
            f"env: actuation_delay = {task.actuation_delay} s: must be a control period, {task.period} s, at most"
        )
    return late


class GaugedLQG(LQG):
    """`LQG` that reads strain gauges, too."""

    blocks: ClassVar[tuple[str, ...]] = (*SENSORS, *GAUGES, "lap_phase")
