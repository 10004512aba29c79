"""Motors that are not ideal, in plain Python: against the responses of a rigid joint, and conservation laws."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_baselines.lqg import LQG
from flexarm_baselines.plan_follower import PlanFollower
from flexarm_baselines.predictive import NMPC
from flexarm_env.analysis import OperatingPoint, behind_motors, linear_plant, tip
from flexarm_env.envs.hosted import HostedSimulator
from flexarm_env.envs.settings import Settings
from flexarm_env.physics.motors import response
from flexarm_env.simulation.arm import FlexibleArm
from tests.support.envs import bare, vector
from tests.support.plain import PlainEnvironment
from tests.support.refusals import refuses

PERIOD, LIMITS, HUB = 0.01, (150.0, 50.0), 20.0
LAG = (0.013, 0.004)  # [s]
# Links that weigh nothing beside the shoulder's hub: a rigid joint.
RIGID = {"link_lengths": (1.0, 1.0), "masses_per_length": (1e-5, 1e-5), "flexural_rigidities": (1e-3, 1e-3)}
RIGID |= {"shoulder_hub_inertia": HUB, "elbow_hub_inertia": 1.0, "modes_per_link": 1, "coulomb_friction": (0.0, 0.0)}
ROUND: dict[str, Any] = {"arm": RIGID, "side": 1.0, "sensor_position": 1.0, "start": "corner"}


def torques(env: PlainEnvironment, actions: list[tuple[float, float]]) -> np.ndarray:
    """Return `info["torque"]` of each period. Shape (periods, 2)."""
    return env.follow(actions, "TORQUE")[0][1:]


@given(st.floats(1e-9, 1e9))
def test_a_step_has_the_moments_of_the_exponential(lag: float) -> None:
    """The parabola through the three instants: by Simpson's rule, which is exact for it and for it times t."""
    start, middle, end, after = response(lag)
    exact = -np.expm1(-lag) / lag
    assert after == pytest.approx(np.exp(-lag), abs=1e-15)
    assert (start + 4.0 * middle + end) / 6.0 == pytest.approx(exact, abs=1e-14)
    first = (exact - np.exp(-lag)) / lag if lag > 1e-3 else 0.5 - lag / 3.0 + lag**2 / 8.0
    assert (2.0 * middle + end) / 6.0 == pytest.approx(first, abs=1e-10)


def test_torques_follow_the_exponential_of_each_command() -> None:
    """Their means do, which carry the momentum; it is that of the whole arm about the shoulder."""
    env = PlainEnvironment(arm={"modes_per_link": 1}, motor_time_constant=LAG, start="corner")
    actions = [(0.5, -0.25), (-0.25, 0.75), (0.0, 0.0), (1.0, 1.0)]
    found = torques(env, actions)
    for joint, (time, limit) in enumerate(zip(LAG, LIMITS, strict=True)):
        decay, acting = np.exp(-PERIOD / time), 0.0
        for action, mean in zip(actions, found, strict=True):
            wanted = limit * action[joint]
            assert mean[joint] == pytest.approx(wanted + (acting - wanted) * time / PERIOD * (1.0 - decay), abs=1e-9)
            acting = wanted + (acting - wanted) * decay
    arm = env.simulator.settings.flexible_arm
    assert arm.angular_momentum(env.result("STATE")) == pytest.approx(PERIOD * found[:, 0].sum(), rel=1e-9)
    env.reset()
    np.testing.assert_array_equal(torques(env, actions), found)  # the motors of a new episode are off


def test_a_joint_approaches_the_no_load_speed_and_is_braked_by_the_whole_torque() -> None:
    """J w' = tau (1 - w / w0): w = w0 (1 - exp(-tau t / (J w0))); against the motion the torque does not fall."""
    speed = 0.8
    env = PlainEnvironment(**ROUND, torque_speed_limit=(speed, 1e6), physics_step=1e-3)
    (states,), time = env.follow([(1.0, 0.0)] * 30, "STATE"), speed * HUB / LIMITS[0]
    elapsed = PERIOD * np.arange(31)
    np.testing.assert_allclose(states[:, 4], speed * -np.expm1(-elapsed / time), rtol=1e-5)  # the links' inertia
    np.testing.assert_allclose(torques(env, [(-1.0, 0.0)] * 3)[:, 0], -LIMITS[0])
    env.step((0.0, 0.0))
    assert env.result("TORQUE")[0] == 0.0


def test_commands_are_multiples_of_the_resolution_within_the_limit() -> None:
    env = PlainEnvironment(arm={"modes_per_link": 1}, torque_resolution=(20.0, 0.0))
    shares = np.array([1.0, -1.0, 0.2, -0.2, 0.0666, 0.0667, -0.0666, -0.0667], dtype=np.float32).tolist()
    found = torques(env, [(share, share) for share in shares])
    np.testing.assert_allclose(found[:, 0], [140.0, -140.0, 40.0, -40.0, 0.0, 20.0, 0.0, -20.0], rtol=1e-12)
    np.testing.assert_allclose(found[:, 1], 50.0 * np.array(shares), rtol=1e-12)


def test_an_imu_feels_the_torque_that_acts() -> None:
    """Slow motors have no torque yet, and what it reads grows in proportion to their torque."""
    options = {"observation": ["accelerometer"], "imu_link": 2, "imu_range": (1e6, 1e6), "start": "corner"}
    times = {"control_period": 1e-5, "physics_step": 1e-5, "motor_time_constant": (10.0, 10.0), "delay": 0.0}
    env = PlainEnvironment(arm={"modes_per_link": 1}, **options, **times)
    ((_, once, twice),) = env.follow([(0.0, 1.0)] * 2, "FURTHER_READING")
    assert np.abs(once).max() > 1e-4
    np.testing.assert_allclose(twice[:2], 2.0 * once[:2], rtol=1e-3, atol=1e-9)


@pytest.mark.slow
def test_the_default_step_suits_motors() -> None:
    """Against steps of a quarter, after a second of random torques; ideal motors: 0.16 mm."""
    options: dict[str, Any] = {"arm": "default", "torque_speed_limit": (6.0, 9.0), "motor_time_constant": (2e-4, 3e-3)}
    options |= {"deflection_limit": None, "error_limit": None, "start": "corner"}
    tips, actions = [], np.random.default_rng(0).uniform(-1.0, 1.0, (20, 32, 2)).astype(np.float32)
    for step in (None, 0.25 * Settings.of(options).integration.step):
        env = vector(seed=1, num_envs=32, physics_step=step, **options)
        tips.append([env.step(actions[k // 5])[4]["true_tip"] for k in range(100)][-1])
    assert np.median(np.linalg.norm(tips[0] - tips[1], axis=1)) < 2e-4


def test_a_linear_plant_behind_motors_has_their_response() -> None:
    """G(s) diag(1 / (1 + s T)); the elbow's motor is ideal."""
    plant = linear_plant(OperatingPoint.at_angles(FlexibleArm(), (0.1, 1.0)), tip(delay=0.03))
    late = behind_motors(plant, (0.02, 0.0))
    for s in (3j, 1.0 + 40j):
        np.testing.assert_allclose(late.at(s), plant.at(s) @ np.diag([1.0 / (1.0 + 0.02 * s), 1.0]), rtol=1e-9)
    assert late.states[-1] == "shoulder_acting"
    assert len(late.pade(2).states) == len(late.states) + 4
    for one, times in ((plant, (-1.0, 0.0)), (late, (0.1, 0.1))):
        with refuses(ValueError, "time_constants = [", "at least 0, and given once"):
            behind_motors(one, times)


@pytest.mark.parametrize("options", [{"motor_time_constant": LAG}, {"torque_speed_limit": (5.0, 5.0)}], ids=str)
def test_what_knows_ideal_motors_alone_refuses_others(options: dict[str, Any]) -> None:
    (name,) = options
    with refuses(ValueError, name, "ideal"):
        HostedSimulator(Settings.of(options), None)  # type: ignore[arg-type]
    for controller in (PlanFollower, LQG, NMPC):
        env = bare(**controller.options(), **options)
        with refuses(ValueError, name, f"{controller.__name__} plans for ideal motors", "motors=()"):
            controller.for_env(env)
    for mode in ("residual", "reference", "gain"):
        with refuses(ValueError, f"{name} = ", "has no effect", "'torque' or 'torque_rate'"):
            Settings.of({"action_mode": mode, **options})
    with refuses(ValueError, "torque_resolution = (1.0, 60.0)", "at most torque_limit", "(150.0, 50.0)"):
        Settings.of({"torque_resolution": (1.0, 60.0)})
    drawn = {"torque_limit": ((90.0, 150.0), (30.0, 50.0)), "torque_resolution": ((1.0, 100.0), (1.0, 2.0))}
    with refuses(ValueError, "torque_resolution = (100.0, 2.0)", "at most torque_limit", "(90.0, 30.0)"):
        Settings.of({"randomisation": drawn})  # an episode may have the coarsest steps and the lowest limit
