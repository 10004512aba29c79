"""`InertialLQG`: LQG that reads an inertial measurement unit (IMU) at the tip of link 2, too.

The IMU's three readings are functions of the state and of the torque that acts, so that they correct the estimate as
encoders do, linearised along the plan; nothing is integrated. Source: Titterton and Weston, *Strapdown inertial
navigation technology*, 2nd ed. 2004, section 2.2 (specific force); Anderson and Moore, *Optimal Filtering*, 1979,
section 3.4 (independent readings correct one after the other, in any order).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from flexarm_baselines.arrays import Floats, product
from flexarm_baselines.controller import Memory, Seen
from flexarm_baselines.lqg.controller import LQG, NOISE
from flexarm_baselines.observers import SENSORS, KalmanFilter, NoiseModel
from flexarm_baselines.optimal import Plan
from flexarm_baselines.task import Task
from flexarm_env.physics.sensing import Motion, Mount, inertial
from flexarm_env.simulation.arm import FlexibleArm

IMU = ("accelerometer", "gyro")
SENSOR = (0.05, 0.002)  # standard deviations of the sensor's own noise [m/s^2], [rad/s]
# Standard deviations that the filter assumes, along and across the tangent [m/s^2], and of the gyro [rad/s]. Those of
# the accelerometer are the spread of its readings over the unknown arms in equal states under equal torques along the
# plans; the gyro sees the vibrations that the encoders' rates see, and is trusted as they are.
TRUST = (6.0, 34.0, NOISE.joint_rate)
DIFFERENCE = 1e-5  # of states and torques, for central differences


class InertialLQG(LQG):
    """LQG from encoders, the late tip, and an IMU at the tip of link 2.

    Attributes:
        before: torques of the plan that act before each instant [N m]. Shape (l, N, 2).
        gain: on the IMU's residual, before the other readings correct. Shape (l, N, d, 3).
        expected: what the IMU reads on the plan [m/s^2, rad/s]. Shape (l, N, 3).
        by_state: its derivatives. Shape (l, N, 3, s).
        by_torque: its derivatives by those torques. Shape (l, N, 3, 2).
    """

    blocks: ClassVar[tuple[str, ...]] = (*SENSORS, *IMU, "lap_phase")

    def __init__(
        self,
        task: Task,
        plans: Sequence[Plan] | None = None,
        noise: NoiseModel = NOISE,
        trust: tuple[float, float, float] = TRUST,
        **design: Any,
    ) -> None:
        """Design the filter anew, with the IMU.

        Args:
            task: see `Task`.
            plans: see `LQG`.
            noise: standard deviations that the filter assumes of encoders, tip and model.
            trust: those of the IMU's accelerometer, along and across the tangent [m/s^2], and of its gyro [rad/s].
            **design: see `LQG`.

        Raises:
            ValueError: if the payload changes, the IMU is not at the tip of link 2 or late, or as in `LQG`.
        """
        if task.imu is not None and task.imu != (2, task.arm.link_lengths[1], 0.0):
            link, position, delay = task.imu
            raise ValueError(
                f"env: imu_link = {link}, imu_position = {position} m, imu_delay = {delay} s: must be at the tip of "
                "link 2, and not late"
            )
        if task.payloads is not None:
            raise ValueError("env: payload_changes: what the IMU should read is computed for one payload throughout")
        super().__init__(task, plans, noise=noise, **design)
        self.before = np.stack([np.vstack([np.zeros(2), plan.torques[:-1]]) for plan in self.plans])
        states = np.stack([plan.states[:-1] for plan in self.plans])
        self.expected, self.by_state, self.by_torque = readings_along(self.kalman.arm, states, self.before)
        self.gain = self._with_imu(self.kalman, np.square(trust))

    @classmethod
    def options(cls) -> dict[str, Any]:
        """Return the options with which an environment gives the controller what it reads."""
        return super().options() | {"imu_link": 2, "imu_noise": SENSOR}

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Correct the estimate by the IMU, and go on as LQG does."""
        estimate, chosen, before, *rest = memory
        at = chosen, self.period_of(seen)
        off = (estimate - self.filter.nominal[at])[:, : self.by_state.shape[-1]]
        known = self.expected[at] + product(self.by_state[at], off)
        known += product(self.by_torque[at], before - self.before[at])
        read = np.concatenate([seen[name] for name in IMU], axis=1)
        return super().torque(seen, (estimate + product(self.gain[at], read - known), chosen, before, *rest))

    def _with_imu(self, kalman: KalmanFilter, variances: Floats) -> Floats:
        """Put the gains of a filter that has the IMU in the place of the others, and return those on the IMU."""
        tables, size = self.filter, self.by_state.shape[-1]
        along = kalman.linearise(
            np.concatenate([plan.states[:-1] for plan in self.plans]),
            np.concatenate([plan.torques for plan in self.plans]),
        )
        count, periods = tables.gain.shape[:2]
        covariance = kalman.start(np.stack([plan.states[0] for plan in self.plans])).covariance
        there = np.ones((count, len(tables.rows)), dtype=bool)
        found = np.empty((count, periods, kalman.size, 3))
        for k in range(periods):
            correlated = covariance[:, :, :size] @ self.by_state[:, k].swapaxes(1, 2)
            expected = self.by_state[:, k] @ correlated[:, :size] + np.diag(variances)
            found[:, k] = np.linalg.solve(expected, correlated.swapaxes(1, 2)).swapaxes(1, 2)
            covariance = covariance - found[:, k] @ correlated.swapaxes(1, 2)
            tables.gain[:, k], covariance, _ = kalman.gain(covariance, there)
            now = along._replace(
                matrix=along.matrix.reshape(count, periods, kalman.size, -1)[:, k],
                by_torque=along.by_torque.reshape(count, periods, kalman.size, 2)[:, k],
            )
            covariance = kalman.spread(covariance, now)
        return found


def readings_along(arm: FlexibleArm, states: Floats, torques: Floats) -> tuple[Floats, Floats, Floats]:
    """Return what an IMU at the tip of link 2 reads, and its derivatives by state and torque.

    Args:
        arm: the arm.
        states: Shape (..., 4 + 4 m).
        torques: that act [N m]. Shape (..., 2).

    Returns:
        Specific force along and across the tangent [m/s^2] and the tangent's angular rate [rad/s], Shape (..., 3), and
        the derivatives, Shape (..., 3, 4 + 4 m) and (..., 3, 2).
    """

    def slopes(steps: Floats) -> Floats:
        return np.stack([(read(step) - read(-step)) / (2.0 * DIFFERENCE) for step in DIFFERENCE * steps], axis=-1)

    def read(step: Floats) -> Floats:
        return inertial_reading(arm, states + step[:size], torques + step[size:])

    size = states.shape[-1]
    steps = np.eye(size + 2)
    return read(np.zeros(size + 2)), slopes(steps[:size]), slopes(steps[size:])


def inertial_reading(arm: FlexibleArm, states: Floats, torques: Floats) -> Floats:
    """Return what an IMU at the tip of link 2 reads. Shape (..., 3); arguments as in `readings_along`."""
    size, length = arm.size, arm.parameters.link_lengths[1]
    mount = Mount(2, arm.place(2, length), tuple(arm.modes[1].slope(length)))
    moving = np.concatenate([states[..., size:], arm.acceleration(states, torques)], axis=-1)
    y, v = np.split(np.moveaxis(arm.internal_state(states), -1, 0), 2)
    acceleration = np.moveaxis(arm.internal_state(moving), -1, 0)[size:]
    found = inertial(arm.constants, mount, Motion(list(y), list(v), list(acceleration)))
    return np.stack(np.broadcast_arrays(*found), axis=-1)
