"""Feed-forward of the bending arm, filtered feedback of the joints and the gauges, and the disturbance observer."""

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest

from flexarm_baselines.arrays import Floats
from flexarm_baselines.controller import Seen
from flexarm_baselines.gauged_tracking import GaugedTracking
from flexarm_baselines.joint_space.disturbance_observer import RATE, ObservedTracking
from flexarm_baselines.joint_space.flexible_motion import first_free_vibration, flexible_motion, rigid_motion
from flexarm_baselines.joint_space.tracking import DECOUPLED, FINE, JointFeedback, JointTracking, Shape
from flexarm_baselines.registry import controller, make_controller
from flexarm_baselines.task import Task
from flexarm_env import ArmParameters, FlexibleArm, SquareParameters, square
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy
from tests.support.refusals import refused

ID = "flexarm_env:FlexArm/Square-v0"
BLOCKS = {"joint_angles": slice(0, 2), "joint_rates": slice(2, 4), "lap_phase": slice(4, 6)}
TASK = Task(ArmParameters(), square(SquareParameters()), blocks=BLOCKS, scale=np.ones(6))
ARM = FlexibleArm(TASK.arm)


def move(duration: float) -> np.ndarray:
    """Joint angles of a smooth move from rest to rest, with a second of rest on both sides."""
    time = np.arange(-1.0, duration + 1.0, FINE)
    s = np.clip(time / duration, 0.0, 1.0)[:, None]
    share = s**5 * (126.0 - 420.0 * s + 540.0 * s**2 - 315.0 * s**3 + 70.0 * s**4)  # four derivatives are continuous
    return np.array([0.3, 1.2]) + share * np.array([0.6, -0.5])


def test_the_bending_arms_tip_goes_where_the_rigid_ones_would() -> None:
    joints = move(2.0)
    motion, rigid = flexible_motion(ARM, joints, FINE), rigid_motion(ARM, joints, FINE)
    size = ARM.size
    np.testing.assert_allclose(ARM.tip(motion.states[:, :size]), ARM.tip(rigid.states[:, :size]), atol=1e-6)
    assert np.abs(ARM.tip_deflection(motion.states[:, :size])).max() > 0.05  # it does bend
    assert motion.residual < 0.02 * np.abs(motion.torques).max()


@pytest.fixture(scope="module")
def tracking() -> JointTracking:
    return JointTracking(TASK)


def observed(joints: Any, rates: Any, period: int) -> np.ndarray:
    angle = 2.0 * np.pi * period / TASK.periods
    return np.array([*joints, *rates, np.cos(angle), np.sin(angle)], dtype=np.float32)


def test_on_its_targets_it_gives_the_feed_forward(tracking: JointTracking) -> None:
    steady = tracking.targets(-1.0, None)
    state = None
    for period in (700, 701):
        goal = steady.joints[period]
        action, state = tracking.predict(observed(goal[:2] + np.array([2.0 * np.pi, 0.0]), goal[2:], period), state)
        np.testing.assert_allclose(action * TASK.torque_limit, steady.torques[period], atol=2e-3)


def test_a_start_from_rest_joins_the_motion(tracking: JointTracking) -> None:
    steady, started = tracking.targets(1.0, None), tracking.targets(1.0, 400)
    np.testing.assert_allclose(started.joints[400, 2:], 0.0, atol=0.15)  # the bounded solution begins before the path
    q = np.append(started.joints[400, :2], np.zeros(ARM.size - 2))
    np.testing.assert_allclose(ARM.rigid_tip(q), (-6.3, 6.3), atol=0.08)
    off = started.joints[700] - steady.joints[700]
    off[0] -= 2.0 * np.pi * np.round(off[0] / (2.0 * np.pi))
    np.testing.assert_allclose(off, 0.0, atol=1e-3)
    np.testing.assert_allclose(started.torques[700], steady.torques[700], atol=0.05)


def test_filters_forget_and_gains_push_back() -> None:
    feedback = JointFeedback((100.0, 50.0), (10.0, 5.0), angle_filter=0.1, rate_filter=0.0)
    tracking = JointTracking(TASK, feedforward="none", feedback=feedback)
    goal = tracking.targets(-1.0, None).joints
    _, state = tracking.predict(observed(goal[800, :2], goal[800, 2:], 800))
    action, _ = tracking.predict(
        observed(np.add(goal[801, :2], [0.1, 0.0]), np.add(goal[801, 2:], [0.0, 0.2]), 801), state
    )
    passed = 1.0 - np.exp(-0.1)  # of the angle; the rate is not filtered
    np.testing.assert_allclose(action * TASK.torque_limit, [-100.0 * 0.1 * passed, -5.0 * 0.2], atol=1e-2)


def test_decoupled_gains_are_accelerations_of_the_rigid_arm() -> None:
    feedback = JointFeedback((2.0, 2.0), (1.0, 1.0), decoupled=True)
    tracking = JointTracking(TASK, feedforward="rigid", feedback=feedback)
    found = tracking.targets(-1.0, None)
    q = np.append(found.joints[30, :2], np.zeros(ARM.size - 2))
    np.testing.assert_allclose(found.gains[30, :, :2], 2.0 * ARM.mass_matrix(q)[:2, :2])


def test_after_a_lap_the_motion_goes_on(tracking: JointTracking) -> None:
    _, state = tracking.predict(observed([-2.4977, -0.2824], [0.0, 0.0], 0))
    assert state is not None
    first, later, elapsed, filtered = state
    goal = tracking.targets(-1.0, None)
    seen, lap_on = observed(goal.joints[50, :2], goal.joints[50, 2:], 50), elapsed + 1649.0
    action, _ = tracking.predict(seen, (first, later, lap_on, 0.0 * filtered))
    np.testing.assert_allclose(action * TASK.torque_limit, goal.torques[50], atol=2e-3)


def test_a_flag_begins_the_episode_of_one_arm(tracking: JointTracking) -> None:
    seen = observed([-2.4977, -0.2824], [0.0, 0.0], 0)
    first, state = tracking.predict(seen)
    for flag in (True, np.array(True), np.array([True])):
        np.testing.assert_array_equal(tracking.predict(seen, state, flag)[0], first)


def test_late_motors_get_the_torques_of_later_periods(tracking: JointTracking) -> None:
    """Also where they are later than the margin of the table."""
    late = JointTracking(replace(TASK, actuation_delay=3.0))
    (_, torques), (_, wanted) = (one.motion(-1.0, None) for one in (late, tracking))
    np.testing.assert_allclose(torques, np.roll(wanted, -300, axis=0), atol=0.02)


test_refusals = refused(
    (lambda: JointTracking(TASK, feedforward="full"), "feedforward = 'full'"),
    (lambda: JointTracking(TASK, Shape(shaper="UM")), "shaper = 'UM'"),
    (lambda: JointTracking(TASK, Shape(window=5.0)), r"window = 5\.0 s: with the impulses the shape is 20\.0 s wide"),
    (lambda: Shape(ramp=-1.0), r"ramp = -1\.0"),
    (lambda: JointFeedback(stiffness=(1.0, -1.0)), r"stiffness"),
    (
        lambda: JointFeedback(resistance=(1.0, -1.0), decoupled=True),
        r"resistance\[1\] = -1\.0: must be .*>= 0\.0 \[1/s\]",
    ),
    (lambda: JointFeedback(decoupled="yes"), "TypeError: decoupled = 'yes': must be True or False"),  # type: ignore[arg-type]
    (lambda: JointFeedback(rate_filter=-0.1), r"rate_filter = -0\.1"),
    (lambda: ObservedTracking(TASK, rate=-1.0), r"rate = -1\.0"),
)


def test_the_first_free_vibration() -> None:
    assert first_free_vibration(ARM) == pytest.approx(37.4, abs=0.1)
    stiff = FlexibleArm(replace(TASK.arm, flexural_rigidities=(4.0 * 1676.0,) * 2))
    assert first_free_vibration(stiff) == pytest.approx(2.0 * 37.44, abs=0.1)


@pytest.mark.parametrize("lap", LAPS)
def test_command_shaping_keeps_the_first_side(lap: str) -> None:
    """Two seconds after the start, with the first corner to come: its own blending is 0.16 m there."""
    env = gymnasium.make(ID, **controller("shaped").options)
    run = run_policy(env, make_controller("shaped", env), lap=lap, max_steps=350)
    away = np.linalg.norm(run.tip - run.reference, axis=1)
    assert np.sqrt(np.mean(away[200:] ** 2)) < 0.12


def test_gauges_damp_what_joint_feedback_leaves() -> None:
    """A heavier tip vibrates after the start; feedback of the bending leaves less than a third of the error."""
    left = []
    for kind in (JointTracking, GaugedTracking):
        nominal = gymnasium.make(ID, **kind.options())
        nominal.reset(seed=0, options=LAPS["plain"].reset_options())
        env = gymnasium.make(ID, arm={"payload_mass": 0.5}, **kind.options())
        run = run_policy(env, kind.for_env(nominal), lap="plain", max_steps=400)
        left.append(np.sqrt(np.mean(np.sum((run.tip - run.reference)[200:] ** 2, axis=1))))
    assert left[1] < left[0] / 3.0


def test_gauges_hold_a_load_that_is_picked_up() -> None:
    """The regulators are designed for what the tip carries; those for the empty tip lose the arm after 0.4 s."""
    env = gymnasium.make("flexarm_env:FlexArm/Carry-v0", randomisation={}, **GaugedTracking.options())
    run = run_policy(env, GaugedTracking.for_env(env), lap="plain", max_steps=100)
    assert run.notes["ended"] == "truncated"


PERIOD, ELBOWS = 0.01, (0.28, 0.8, 1.2, 1.57)  # [s], [rad]


@pytest.fixture(scope="module")
def observer() -> ObservedTracking:
    return ObservedTracking.for_env(gymnasium.make(ID, **ObservedTracking.options()))


def energy(arm: FlexibleArm, angles: Floats, rates: Floats) -> float:
    """Kinetic energy of the arm with straight links [J]."""
    q = np.zeros(arm.size)
    q[:2] = angles
    return float(0.5 * rates @ arm.mass_matrix(q)[:2, :2] @ rates)


def test_momenta_and_what_carries_them_are_derivatives_of_the_kinetic_energy(observer: ObservedTracking) -> None:
    angles, rates, step = np.array([0.3, 1.1]), np.array([0.7, -1.3]), 1e-5
    row = np.zeros(len(observer.task.scale))
    row[observer.task.blocks["joint_angles"]], row[observer.task.blocks["joint_rates"]] = angles, rates
    seen = Seen(observer.task, row[None])
    for found, of_rates in ((observer.momentum(seen), True), (observer.by_angles(seen), False)):
        for n, change in enumerate(step * np.eye(2)):
            ends = ((angles, rates + s * change) if of_rates else (angles + s * change, rates) for s in (1.0, -1.0))
            ahead, behind = (energy(observer.arm, *end) for end in ends)
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


def test_without_a_rate_it_is_computed_torque(observer: ObservedTracking) -> None:
    silent = ObservedTracking(observer.task, rate=0.0)
    observation = np.random.default_rng(0).normal(0.0, 0.1, (3, len(observer.task.scale))).astype(np.float32)
    state = silent.predict(observation)[1]
    later = 2.0 * observation
    expected, _ = super(ObservedTracking, silent).torque(Seen(silent.task, later), state[:4])
    found, _ = silent.torque(Seen(silent.task, later), state)
    limit = np.asarray(silent.task.torque_limit)
    np.testing.assert_allclose(found, expected.clip(-limit, limit))
