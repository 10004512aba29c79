"""What is around a hosted plant, seen on our own arm as one: the same as around the arm within the kernels."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from flexarm_env import FlexibleArm
from flexarm_env.envs.drawing import Drawing, drawing_of
from flexarm_env.envs.hosted import HostedSimulator, Plant
from flexarm_env.envs.settings import Settings
from flexarm_env.physics import sensing
from tests.support.envs import Array
from tests.support.plain import PlainEnvironment
from tests.support.refusals import refuses

ONE_MODE = {"arm": {"modes_per_link": 1}}
FURTHER_SENSORS = {
    "second_sensor_link": 1,
    "second_sensor_position": 4.0,
    "second_sensor_delay": 0.0237,
    "imu_link": 2,
    "imu_delay": 0.0042,
    "observation": ("second_sensed_position", "second_sensor_error", "accelerometer", "gyro"),
}
CASES: dict[str, dict[str, Any]] = {
    "defaults": {"start": "mix"},
    "disturbed": {
        "noise": 0.01,
        "encoder_noise": (1e-3, 1e-2),
        "jitter": 0.01,
        "dropout": 0.1,
        "actuation_delay": 0.013,
        "randomisation": {"payload_mass": (0.0, 0.5), "stiffness": (0.9, 1.1), "damping": (0.0, 0.02)},
    },
    "torque rate": {"action_mode": "torque_rate", "torque_rate_limit": (1000.0, 400.0)},
    "further sensors": FURTHER_SENSORS,
    "joint angles, moves": {"sensor": "rigid", "reference": "moves", "start": "corner", "elbow_branch": "either"},
}


class ModalPlant:
    """The settings' arm as a hosted plant: what it gives is known from the compiled one."""

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
        drawn = {"payload_mass": quantities["payload_mass"], "damping_ratio": quantities["damping"]}
        self.arm = FlexibleArm(replace(own, flexural_rigidities=rigidities, **drawn))
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
            quantity = sensing.QUANTITIES_AT_A_POINT[one.sensor.quantity]
            read = [*read, *quantity.formula(self.arm.constants, mount, motion)]
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


def started(options: dict[str, Any]) -> HostedSimulator:
    settings = Settings.of(options)
    hosted = HostedSimulator(settings, ModalPlant(settings))
    hosted.start(np.array([5], dtype=np.uint64), np.zeros(1, dtype=np.int64), hosted.usual_requests)
    return hosted


pytestmark = pytest.mark.usefixtures("uncompiled")


@pytest.mark.parametrize("name", CASES)
def test_all_around_the_arm_is_the_same(name: str) -> None:
    options = {**CASES[name], **ONE_MODE}
    within, hosted = PlainEnvironment(**options), started(options)
    within.reset(key=5)
    actions = np.random.default_rng(0).uniform(-0.3, 0.3, (6, 2))
    for action in [None, *actions]:
        if action is not None:
            within.step(action)
            hosted.actions[0] = action
            hosted.step()
        np.testing.assert_allclose(hosted.result(0), within.simulator.result(0), rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(hosted.observations, within.simulator.observations, rtol=1e-6, atol=1e-6)


def test_an_action_that_is_not_finite_is_refused_before_anything_moves() -> None:
    hosted = started(ONE_MODE)
    before = hosted.result(0)
    hosted.actions[0] = np.nan
    with pytest.raises(ValueError, match="must be finite"):
        hosted.step()
    np.testing.assert_array_equal(hosted.result(0), before)


@pytest.mark.parametrize("name", ["get_state", "set_state"])
def test_a_plant_that_inherits_what_the_protocol_has_cannot_be_copied(name: str) -> None:
    plant = type("Stub", (ModalPlant,), {name: getattr(Plant, name)})
    hosted = HostedSimulator(Settings.of(ONE_MODE), plant(Settings.of(ONE_MODE)))
    with refuses(NotImplementedError, f"Stub has no {name}: states of this environment cannot be copied"):
        hosted.get_states(np.zeros(1, dtype=np.int64), np.zeros((1, 5), dtype=np.uint64))
