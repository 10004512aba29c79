"""The paper's set-up, `FlexArm/Paper-v0`: the law's torque, what its sensor sees, how an episode ends."""

from functools import partial
from typing import Any

import numpy as np

from flexarm_env import ArmParameters, SquareParameters, square
from flexarm_env.envs.single import FlexArmEnv
from tests.support.envs import PAPER, Array, bare, block, played

STEPS = 60


paper = partial(bare, PAPER)


def recorded(env: FlexArmEnv) -> tuple[Array, dict[str, Array]]:
    return played(env, np.random.default_rng(2).uniform(-1.0, 1.0, (STEPS, 1)).astype(np.float32), 2)


def test_the_set_up() -> None:
    env = paper()
    assert env.arm.parameters == ArmParameters.paper()
    assert env.settings.sensor_parameters.joint_delays(4.5) == (9.0 / 288.33, 4.5 / 288.33)
    law = env.settings.law
    assert (law.proportional_gain, law.derivative_gain, law.torque_limit) == (150.79, 17.364, None)
    assert (env.control_period, env.gain_limit, env.settings.substeps) == (1e-3, 1.0, 4)


def law_without_gain(env: FlexArmEnv, info: dict[str, Any]) -> Array:
    """J^T (Kp e + Kd e') (10) at an instant of an undelayed run on the first side."""
    theta1, theta2, *_ = info["state"]
    rates = info["state"][env.arm.size : env.arm.size + 2]
    s1, c1, s12, c12 = np.sin(theta1), np.cos(theta1), np.sin(theta1 + theta2), np.cos(theta1 + theta2)
    p = 4.5 * np.array([c1 + c12, s1 + s12])
    J = 4.5 * np.array([[-s1 - s12, -s12], [c1 + c12, c12]])
    error = np.array([-6.3, -6.3 + 3.15 * info["time"]]) - p
    return np.asarray(J.T @ (150.79 * error + 17.364 * (np.array([0.0, 3.15]) - J @ rates)))


def test_the_torque_is_the_papers_law_times_the_gain() -> None:
    """Actions of -1 to 1, limited to that, are gains of 0 to `gain_limit`; a reset has neither gain nor torque."""
    env = paper(sensor="collocated", gain_limit=4.0)
    info = env.reset(seed=0)[1]
    assert [info["gain"], *info["torque"]] == [0.0, 0.0, 0.0]
    for action in (*np.linspace(-1.0, 1.0, 9), -7.0, 1.5, *np.zeros(60)):
        gain = 2.0 * (np.clip(action, -1.0, 1.0) + 1.0)
        expected = gain * law_without_gain(env, info)
        info = env.step(np.array([action], np.float32))[4]
        assert info["gain"] == gain
        # rounding of the position, 1e-15 m, times gains of up to 1e4 N m/m; the command's velocity is a difference
        # quotient over 0.25 ms, with 1e-11 m/s of rounding
        np.testing.assert_allclose(info["torque"], expected, rtol=1e-9, atol=1e-8)


def test_the_reference_where_corners_fall_between_the_instants() -> None:
    """It neither overshoots the corner nor turns before it."""
    env = paper(lap_time=0.0404, gain_limit=1e-6)
    observations, _ = recorded(env)
    path = square(SquareParameters(lap_time=0.0404))
    times = 1e-3 * np.arange(STEPS + 1)
    np.testing.assert_array_equal(block(env, observations, "reference_position"), np.float32(path.position(times)))
    np.testing.assert_array_equal(block(env, observations, "reference_velocity"), np.float32(path.velocity(times)))


def test_info_and_tips() -> None:
    env = paper(arm="default")
    _, infos = recorded(env)
    q = infos["state"][:, : env.arm.size]
    np.testing.assert_allclose(infos["true_tip"], env.arm.tip(q), atol=1e-13)
    np.testing.assert_allclose(infos["rigid_tip"], env.arm.rigid_tip(q), atol=1e-13)
    np.testing.assert_allclose(infos["time"], 1e-3 * np.arange(STEPS + 1), rtol=1e-12)
    np.testing.assert_allclose(infos["reference"], square(SquareParameters()).position(infos["time"]), atol=1e-14)
    np.testing.assert_allclose(infos["rigid_tip"][0], (-6.3, -6.3), atol=1e-14)
    assert not infos["state"][0, 2:].any()  # at rest, straight
    assert infos["state"][0, 1] > 0.0
    assert paper(elbow_branch="negative").reset()[1]["state"][1] < 0.0
