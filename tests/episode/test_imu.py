"""The IMU in an environment, in plain Python: what it measures, its noise, bias, range and delay; counting encoders."""

from typing import Any

import numpy as np
import pytest

from flexarm_env.envs.info import InfoMaker
from tests.support.plain import PlainEnvironment

IMU: dict[str, Any] = {
    "arm": {"modes_per_link": 1},
    "observation": ["accelerometer", "gyro"],
    "start": "corner",
    "scaled": False,
    "frame": "world",
    "delay": 0.0,  # of the tip sensor, whose readings need not be kept
}
PERIOD = 2e-5  # [s], in one step


def mounted(link: int = 2, **options: Any) -> PlainEnvironment:
    """Make an environment whose control period is one short step, at the start of an episode."""
    return PlainEnvironment(1, **IMU, imu_link=link, control_period=PERIOD, physics_step=PERIOD, **options)


@pytest.mark.parametrize(("link", "place"), [(1, 3.0), (2, 2.0)])
@pytest.mark.parametrize("mode", ["torque", "residual", "gain"])
def test_it_measures_acceleration_and_rate(mode: str, link: int, place: float) -> None:
    """Difference quotients of the point's position, and of the angle of the link's tangent there, say the same."""
    env = mounted(link, imu_position=place, imu_range=(1e6, 1e6), action_mode=mode)
    states, read = env.follow([[0.3, -0.4] if mode != "gain" else [0.3]] * 12, "STATE", "FURTHER_READING")
    arm = env.simulator.settings.flexible_arm
    points = arm.position(states[:, :4], link, place)
    angles = states[:, 0] + states[:, 2] * arm.modes[0].slope(place if link == 1 else 4.5)
    if link == 2:
        angles = angles + states[:, 1] + states[:, 3] * arm.modes[1].slope(place)
    x, y = np.diff(points, 2, axis=0).T / PERIOD**2
    cos, sin = np.cos(angles[1:-1]), np.sin(angles[1:-1])
    expected = np.stack([cos * x + sin * y, cos * y - sin * x, (angles[2:] - angles[:-2]) / (2.0 * PERIOD)], axis=-1)
    assert np.abs(expected).max() > 1.0
    assert (read[0] == 0.0).all()  # at rest, with idle motors
    # The first quotient sees the step of the torque. The law's gain sets in fast, so the others are a little off.
    np.testing.assert_allclose(read[2:-1], expected[1:], rtol=3e-3 if mode == "gain" else 1e-4, atol=1e-4)
    env.reset(key=1)
    assert (env.result("FURTHER_READING") == 0.0).all()  # the torques of the episode before are gone


def test_noise_and_bias() -> None:
    """An arm at rest shows them alone: the bias is constant over an episode, the noise white."""
    spreads = np.array([2.0, 2.0, 0.2])
    env = mounted(imu_noise=(0.5, 0.05), imu_bias=(2.0, 0.2))
    (read,) = env.follow([[0.0, 0.0]] * 400, "FURTHER_READING")
    noise = read - env.row("FURTHER_BIAS")
    np.testing.assert_allclose(noise.std(axis=0), [0.5, 0.5, 0.05], rtol=0.15)
    assert (np.abs(noise.mean(axis=0)) < 0.05 * spreads).all()
    assert np.abs(np.corrcoef(noise.T) - np.eye(3)).max() < 0.2
    assert abs(np.corrcoef(noise[1:, 0], noise[:-1, 0])[0, 1]) < 0.2
    biases = []
    for key in range(60):
        env.reset(key)
        biases.append(env.row("FURTHER_BIAS"))
    np.testing.assert_allclose(np.std(biases, axis=0), spreads, rtol=0.3)


def test_it_saturates() -> None:
    env = mounted(imu_range=(1.5, 0.001))
    (read,) = env.follow([[1.0, -1.0]] * 5, "FURTHER_READING")
    np.testing.assert_array_equal(np.abs(read[-1]), [1.5, 1.5, 0.001])
    np.testing.assert_allclose(env.simulator.layout.bound, [1.5, 1.5, 0.001], rtol=1e-6)


def test_a_late_reading() -> None:
    """Whole steps late it is the earlier reading; between two steps it is linear, and before the start the first."""
    envs = (mounted(imu_delay=late * PERIOD) for late in (0.0, 3.0, 2.25))
    (prompt,), (whole,), (between,) = (env.follow([[0.5, -0.5]] * 8, "FURTHER_READING") for env in envs)
    np.testing.assert_allclose(whole[3:], prompt[:-3], rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(whole[:3], 0.0)
    np.testing.assert_allclose(between[3:], 0.75 * prompt[1:-2] + 0.25 * prompt[:-3], rtol=1e-9, atol=1e-9)


def test_its_info_is_its_reading_beside_a_second_sensor() -> None:
    blocks = [*IMU["observation"], "second_sensed_position"]
    env = PlainEnvironment(**(IMU | {"observation": blocks}), imu_link=2, second_sensor_link=1)
    env.step([0.5, -0.5])
    info, read = InfoMaker(env.simulator).read(), env.result("FURTHER_READING")
    np.testing.assert_array_equal(info["second_sensed"], read[:2])
    np.testing.assert_array_equal(info["imu"], read[2:])
    np.testing.assert_allclose(
        np.concatenate(list(map(env.block, blocks))), [*info["imu"], *info["second_sensed"]], rtol=1e-6
    )


@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_encoders_count_angles_and_rates_follow_from_counts(noise: float) -> None:
    """An angle is off by half a count at most, a rate by one count a period, and on average by much less."""
    counts, period = np.array([1e-3, 2e-3]), 0.01
    env = PlainEnvironment(
        arm={"modes_per_link": 1},
        encoder_resolution=tuple(counts),
        encoder_noise=(noise, 0.0),
        observation=("joint_angles", "joint_rates"),
        scaled=False,
        start="corner",
    )
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (60, 2))
    angles, rates, states = (x.astype(float) for x in env.follow(actions, "joint_angles", "joint_rates", "STATE"))
    np.testing.assert_array_equal(rates[0], 0.0)
    steps = np.concatenate([angles / counts, rates * period / counts])
    np.testing.assert_allclose(steps, np.round(steps), atol=1e-2)  # float32 of some thousand counts
    assert np.all(np.abs(angles - states[:, :2]) <= 0.5 * counts + 6.0 * noise + 1e-6)
    off = (rates - states[:, 4:6])[1:] * period / counts
    assert np.abs(off).max() <= 1.0 + 1e-3
    assert np.all(np.abs(np.mean(off, axis=0)) < 0.2)  # deviates of a spread of 0.41: 4 of their mean's
    assert np.all(np.std(off, axis=0) > 0.2)
