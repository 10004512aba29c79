"""Our own arm as the plant of a hosted environment: what it gives is known from the compiled one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env import FlexibleArm
from flexarm_env.envs.drawing import Drawing, drawing_of
from flexarm_env.envs.settings import Settings
from flexarm_env.physics import sensing

Array = NDArray[np.float64]


class ModalPlant:
    """The settings' arm, step by step."""

    def __init__(self, settings: Settings) -> None:
        self.settings, self.arm = settings, settings.flexible_arm
        self.step = settings.control_period / settings.substeps
        self.state, self.torque = np.zeros(2 * self.arm.size), np.zeros(2)

    def begin(self, state: Array, quantities: Mapping[str, float]) -> None:
        self.set_state(np.append(state, np.zeros(2)), quantities)

    def get_state(self) -> Array:
        return np.append(self.state, self.torque)

    def set_state(self, state: Array, quantities: Mapping[str, float]) -> None:
        own = self.settings.flexible_arm.parameters
        rigidities = tuple(quantities["stiffness"] * each for each in own.flexural_rigidities)
        self.arm = FlexibleArm(
            replace(
                own,
                payload_mass=quantities["payload_mass"],
                damping_ratio=quantities["damping"],
                flexural_rigidities=rigidities,
            )
        )
        self.state, self.torque = state[:-2], state[-2:]

    def advance(self, command: Array, reference: Any) -> Array:
        self.state, self.torque = self.arm.step(self.state, command, self.step, step=self.step), command
        return command

    def readings(self) -> Array:
        settings, (y, v) = self.settings, self._internal()
        accelerations = np.concatenate([self.state[self.arm.size :], self.arm.acceleration(self.state, self.torque)])
        motion = sensing.Motion(y, v, self.arm.internal_state(accelerations[None])[0][self.arm.size :])
        read = sensing.reading(self.arm.constants, self.arm.place(2, settings.sensor_position), settings.sensor, y, v)
        for one in settings.further_sensors:
            slopes = self.arm.modes[one.link - 1].slope(one.position)
            mount = sensing.Mount(one.link, self.arm.place(one.link, one.position), slopes)
            read = [
                *read,
                *sensing.QUANTITIES_AT_A_POINT[one.sensor.quantity].formula(self.arm.constants, mount, motion),
            ]
        return np.array(read)

    def encoders(self) -> Array:
        y, v = self._internal()
        return np.array(sensing.angles_reading(self.arm.constants, self.arm.place(2, 0.0), y, v))

    def truth(self) -> sensing.Truth:
        tip = self.arm.place(2, self.arm.parameters.link_lengths[1])
        return sensing.truth(self.arm.constants, tip, *self._internal())

    def drawing(self) -> Drawing:
        return drawing_of(self.settings, self.state)

    def _internal(self) -> tuple[Array, Array]:
        y, v = np.split(self.arm.internal_state(self.state), 2)
        return y, v
