"""LQG with an IMU: what its model says that the IMU reads, and the trust in it."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest
from scipy.stats import qmc

from flexarm_baselines.lqg import LQG, InertialLQG
from flexarm_baselines.lqg.imu import TRUST, inertial_reading, readings_along
from flexarm_env import FlexibleArm
from flexarm_env.envs.registration import UNKNOWN_PLANT

ID = "flexarm_env:FlexArm/Square-v0"


@pytest.fixture(scope="module")
def controller() -> InertialLQG:
    env = gymnasium.make(ID, **InertialLQG.options())
    return InertialLQG.for_env(env)


def test_its_model_of_the_imu_is_the_sensor() -> None:
    """Within the range, a reading is the specific force of the state under the torque that has been held."""
    env = gymnasium.make(ID, **InertialLQG.options() | {"imu_noise": (0.0, 0.0), "imu_range": (1e5, 1e3)})
    env.reset(seed=0)
    for action in np.random.default_rng(0).uniform(-1.0, 1.0, (5, 2)).astype(np.float32):
        *_, info = env.step(action)
        torque = action.astype(np.float64) * [150.0, 50.0]
        found = inertial_reading(env.unwrapped.settings.flexible_arm, info["state"], torque)
        np.testing.assert_allclose(found, info["imu"], rtol=1e-6)


def test_its_derivatives_predict_other_readings(controller: InertialLQG) -> None:
    arm, plan = controller.plans[0].arm, controller.plans[0]
    random = np.random.default_rng(0)
    change, push = 1e-4 * random.normal(size=plan.states.shape[1]), 0.1 * random.normal(size=2)
    state, torque = plan.states[300], plan.torques[299]
    value, by_state, by_torque = readings_along(arm, state, torque)
    found = inertial_reading(arm, state + change, torque + push)
    np.testing.assert_allclose(value + by_state @ change + by_torque @ push, found, atol=1e-3 * np.abs(found).max())


def test_the_trust_in_the_accelerometer_is_its_spread_over_the_published_arms(controller: InertialLQG) -> None:
    box = {name: UNKNOWN_PLANT["randomisation"][name] for name in ("payload_mass", "stiffness", "damping")}
    low, high = np.array(list(box.values())).T
    states = np.stack([plan.states[:-1] for plan in controller.plans])
    squares = []
    for payload, stiffness, damping in low + (high - low) * qmc.Sobol(3, seed=0).random(16):
        rigid = tuple(stiffness * one for one in controller.task.arm.flexural_rigidities)
        arm = replace(controller.task.arm, payload_mass=payload, flexural_rigidities=rigid, damping_ratio=damping)
        read = inertial_reading(FlexibleArm(arm), states, controller.before)
        squares.append((read - controller.expected) ** 2)
    spread = np.sqrt(np.mean(squares, axis=(0, 1, 2)))
    assert spread[:2] == pytest.approx(TRUST[:2], rel=0.15)  # another sample of the box gives other digits
    assert spread[2] < 1e-9  # the tangent's rate depends on no mass


def test_an_imu_that_is_not_trusted_changes_nothing(controller: InertialLQG) -> None:
    assert np.abs(controller.gain).max() > 1e-3
    deaf = InertialLQG(controller.task, trust=(1e9, 1e9, 1e9))
    assert np.abs(deaf.gain).max() < 1e-6
    plain = LQG(replace(controller.task), controller.plans)
    np.testing.assert_allclose(deaf.filter.gain, plain.filter.gain, atol=1e-6 * np.abs(plain.filter.gain).max())
