"""The disturbance observer: its momenta and energies by the mass matrix, and its rate by the loop at rest."""

import gymnasium
import numpy as np
import pytest

from flexarm_baselines.arrays import Floats
from flexarm_baselines.controller import Seen
from flexarm_baselines.joint_space.disturbance_observer import RATE, ObservedTracking
from flexarm_baselines.joint_space.tracking import DECOUPLED
from flexarm_env import FlexibleArm

PERIOD, ELBOWS = 0.01, (0.28, 0.8, 1.2, 1.57)  # [s], [rad]


@pytest.fixture(scope="module")
def controller() -> ObservedTracking:
    return ObservedTracking.for_env(gymnasium.make("flexarm_env:FlexArm/Square-v0", **ObservedTracking.options()))


def energy(arm: FlexibleArm, angles: Floats, rates: Floats) -> float:
    """Kinetic energy of the arm with straight links [J]."""
    q = np.zeros(arm.size)
    q[:2] = angles
    return float(0.5 * rates @ arm.mass_matrix(q)[:2, :2] @ rates)


def test_momenta_and_what_carries_them_are_derivatives_of_the_kinetic_energy(controller: ObservedTracking) -> None:
    angles, rates, step = np.array([0.3, 1.1]), np.array([0.7, -1.3]), 1e-5
    row = np.zeros(len(controller.task.scale))
    row[controller.task.blocks["joint_angles"]], row[controller.task.blocks["joint_rates"]] = angles, rates
    seen = Seen(controller.task, row[None])
    for found, of_rates in ((controller.momentum(seen), True), (controller.by_angles(seen), False)):
        for n, change in enumerate(step * np.eye(2)):
            ends = ((angles, rates + s * change) if of_rates else (angles + s * change, rates) for s in (1.0, -1.0))
            ahead, behind = (energy(controller.arm, *end) for end in ends)
            assert found[0, n] == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-6, abs=1e-6)


def slowest_decay(rate: float) -> float:
    """Decay of the loop at rest with joint feedback, its filters and the observer, at the slowest elbow angle [1/s]."""
    arm = FlexibleArm()
    states = np.zeros((len(ELBOWS), 2 * arm.size))
    states[:, 1] = ELBOWS
    found, size, eye, found_decay = arm.step_jacobians(states, (0.0, 0.0), PERIOD), 2 * arm.size, np.eye(2), np.inf
    read = np.eye(size)[[0, 1, size // 2, size // 2 + 1]]
    keep = np.diag(np.exp(-PERIOD / np.repeat([DECOUPLED.angle_filter, DECOUPLED.rate_filter], 2)))
    smooth = np.exp(-PERIOD * rate)
    for state, by_state, by_torque in zip(states, found.by_state, found.by_torque, strict=True):
        mass = arm.mass_matrix(state[: arm.size])[:2, :2]
        gains = mass @ np.concatenate([np.diag(DECOUPLED.stiffness), np.diag(DECOUPLED.resistance)], axis=1)
        passed = (np.eye(4) - keep) @ read
        estimate = rate * np.hstack([mass @ read[2:], np.zeros((2, 4)), -eye, np.zeros((2, 2))])
        acting = (1.0 - smooth) * estimate + smooth * np.hstack([np.zeros((2, size + 6)), eye])
        torque = -np.hstack([gains @ passed, gains @ keep, np.zeros((2, 4))]) - acting
        moved = np.hstack([by_state, np.zeros((size, 8))]) + by_torque @ torque
        filtered = np.hstack([passed, keep, np.zeros((4, 4))])
        expected = np.hstack([np.zeros((2, size + 4)), eye, np.zeros((2, 2))]) + PERIOD * (torque + estimate)
        loop = np.vstack([moved, filtered, expected, acting])
        found_decay = min(found_decay, float(-np.log(np.abs(np.linalg.eigvals(loop)).max()) / PERIOD))
    return found_decay


def test_its_rate_is_the_one_whose_loop_settles_fastest() -> None:
    tried = [0.1, 0.2, RATE, 0.4, 0.5, 0.7]
    assert max(tried, key=slowest_decay) == RATE
    assert slowest_decay(RATE) > 0.25
    assert slowest_decay(1.5) < 0.0  # a quicker one answers the links' vibrations, and drives them


def test_without_a_rate_it_is_computed_torque(controller: ObservedTracking) -> None:
    silent = ObservedTracking(controller.task, rate=0.0)
    observation = np.random.default_rng(0).normal(0.0, 0.1, (3, len(controller.task.scale))).astype(np.float32)
    state = silent.predict(observation)[1]
    later = 2.0 * observation
    expected, _ = super(ObservedTracking, silent).torque(Seen(silent.task, later), state[:4])
    found, _ = silent.torque(Seen(silent.task, later), state)
    limit = np.asarray(silent.task.torque_limit)
    np.testing.assert_allclose(found, expected.clip(-limit, limit))
    with pytest.raises(ValueError, match=r"rate = -1\.0"):
        ObservedTracking(controller.task, rate=-1.0)
