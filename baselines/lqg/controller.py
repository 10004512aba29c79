"""`LQG`: a plan, a time-varying regulator along it, and a Kalman filter on encoders and the late tip.

Sources: Anderson and Moore, *Optimal Control: Linear Quadratic Methods*, 1990, chapters 3 and 8 (regulator, filter, and
their separation); Anderson and Moore, *Optimal Filtering*, 1979, section 7.3 (late readings by augmentation).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np

from flexarm_baselines.arrays import Floats, Integers
from flexarm_baselines.controller import Memory, Seen, TorqueController
from flexarm_baselines.lqg.laps import Laps, half_turn
from flexarm_baselines.lqg.tables import FilterTables, Place, RegulatorTables, product
from flexarm_baselines.observers import KalmanFilter, NoiseModel, Readings
from flexarm_baselines.optimal import GOOD, Plan, RegulatorWeights
from flexarm_baselines.task import Task
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import choice, number

Delay = Literal["known", "ignored"] | float
DELAYS = ("known", "ignored")
TIP = slice(4, 6)  # of the readings


class LQG(TorqueController):
    """Linear-quadratic-Gaussian control of the arm's deviation from a plan, from encoders and the late tip.

    It takes the lap whose plan begins nearest to the joint angles that it reads first. All its matrices are computed
    beforehand; a control period takes a few products.

    Attributes:
        laps: the plans.
        filter: see `FilterTables`.
        regulator: see `RegulatorTables`.
    """

    blocks: ClassVar[tuple[str, ...]] = ("joint_angles", "joint_rates", "sensed_position", "lap_phase")

    def __init__(
        self,
        task: Task,
        plans: Mapping[str, Plan] | None = None,
        model: FlexibleArm | None = None,
        weights: RegulatorWeights = GOOD,
        noise: NoiseModel | None = None,
        delay: Delay = "known",
        feed_forward: bool = True,
        integral: float | None = None,
    ) -> None:
        """Design filter and regulator.

        Args:
            task: see `Task`.
            plans: for the laps that may be asked for, by name; None: those of the two standard laps.
            model: arm that filter and regulator are designed for; None: the task's.
            weights: of the regulator.
            noise: standard deviations that the filter assumes; None: the defaults of `NoiseModel`.
            delay: "known": the task's; "ignored": the filter takes the late tip for the present one; or another one
                that it reckons with [s].
            feed_forward: the plan's torques act; else feedback alone keeps the arm near the plan.
            integral: integral of the late tip's deviation that weighs as much as the deviations of the weights do
                [m s]; None: no integral action.

        Raises:
            ValueError: naming what does not fit.
        """
        super().__init__(task)
        self.laps = Laps.known(task) if plans is None else Laps(plans, task)
        arm = FlexibleArm(task.arm) if model is None else model
        reckoned = delay if isinstance(delay, float) else task.delay * (choice("delay", delay, DELAYS) == "known")
        kalman = KalmanFilter(arm, task.period, reckoned, task.sensor_position, noise)
        if integral is not None:
            number("integral", integral, "m s", above=0.0)
        self.filter = FilterTables.along(kalman, self.laps.plans, self.reads_gauges())
        self.regulator = RegulatorTables.along(self.laps.plans, weights, arm, integral, feed_forward)

    @classmethod
    def reads_gauges(cls) -> bool:
        """Return whether it reads strain gauges."""
        return "modal_coordinates" in cls.blocks

    def start(self, seen: Seen) -> Memory:
        """Begin on the nearest plan, with no deviation of the state and no integral of the tip's."""
        lap = self.laps.nearest(self._readings(seen).joints[:, :2], self._period(seen))
        return np.zeros((len(seen), self.filter.nominal.shape[2])), lap, np.zeros((len(seen), 2))

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Correct the deviation by the readings, command torques, and predict the next deviation."""
        deviation, lap, integral = memory
        tables, at = self.filter, (lap, self._period(seen))
        off = self._off_plan(seen, at)
        deviation = deviation + product(tables.gain[at], off - deviation[:, tables.rows])
        change = self.regulator.feedback(at, deviation, integral)
        limit = np.asarray(self.task.torque_limit)
        torque = np.clip(self.regulator.torque[at] + change, -limit, limit)
        deviation = tables.predict(at, deviation, torque)
        return self.laps.torques(torque), (deviation, lap, integral + self.task.period * off[:, TIP])

    def _period(self, seen: Seen) -> Integers:
        """Return the control period of the lap that begins now. Shape (n,)."""
        return np.round(seen.time / self.task.period).astype(np.int64)

    def _readings(self, seen: Seen) -> Readings:
        """Return what the sensors read, in the plans' frame."""
        joints = np.concatenate([seen["joint_angles"], seen["joint_rates"]], axis=1)
        gauges = None
        if self.reads_gauges():
            gauges = np.concatenate([seen["modal_coordinates"], seen["modal_rates"]], axis=1)
        return self.laps.readings(Readings(joints, seen["sensed_position"], gauges))

    def _off_plan(self, seen: Seen, at: Place) -> Floats:
        """Return by how much readings differ from those along the plan. Shape (n, r)."""
        readings = self._readings(seen)
        parts = [readings.joints, readings.tip, *([] if readings.gauges is None else [readings.gauges])]
        off = np.concatenate(parts, axis=1) - self.filter.nominal[at][:, self.filter.rows]
        off[:, 0] = half_turn(off[:, 0])
        return off


class GaugedLQG(LQG):
    """`LQG` that reads strain gauges, too."""

    blocks: ClassVar[tuple[str, ...]] = (*LQG.blocks, "modal_coordinates", "modal_rates")
