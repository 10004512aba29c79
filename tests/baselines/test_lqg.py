"""LQG along a plan: its tables beside the filter and the regulator that they stand for; with an IMU; and learning."""

from dataclasses import replace
from functools import partial
from typing import Any

import gymnasium
import numpy as np
import pytest
from scipy.stats import qmc

from flexarm_baselines.arrays import product
from flexarm_baselines.lqg import LQG, NOISE, GaugedLQG, HInfinityLQG, InertialLQG
from flexarm_baselines.lqg.ilc import Lap, learned
from flexarm_baselines.lqg.imu import TRUST, inertial_reading, readings_along
from flexarm_baselines.lqg.tables import FilterTables
from flexarm_baselines.observers import Estimate, KalmanFilter, Readings
from flexarm_baselines.optimal import Plan, PlanRegulator, RegulatorWeights
from flexarm_baselines.optimal.library import mirrored
from flexarm_baselines.plan_follower import PlanFollower
from flexarm_env import FlexibleArm
from flexarm_env.envs.registration import UNKNOWN_PLANT
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy
from tests.support.late_arm import ARM, BLOCKS, DELAY, PLACES, SIZE, START, Plant, off_plan, plan, task
from tests.support.refusals import refused

ID = "flexarm_env:FlexArm/Square-v0"


@pytest.mark.parametrize("kind", [LQG, GaugedLQG, partial(HInfinityLQG, gamma=1e3)])
def test_on_the_plan_it_replays_the_plan(kind: Any) -> None:
    off = off_plan(kind(task(), [plan()]), Plant(np.tile(START, (2, 1))), plan())
    assert np.abs(off).max() < 2e-3  # actions are float32, and fast vibrations follow


def test_mirror_images_are_told_by_the_first_reading() -> None:
    plans = [plan(), replace(mirrored(plan(), 0.3), reference=plan().reference)]
    controller = LQG(task(), plans)
    plant = Plant(np.stack([other.states[0] for other in plans]))
    observation = plant.observe()
    observation[:, 0] += [0.0, 2.0 * np.pi]  # the same place
    action, state = controller.predict(observation)
    assert state[1].tolist() == [0, 1]
    assert action[1] == pytest.approx(-action[0], abs=1e-6)


def test_its_tables_are_the_extended_filter_near_the_plan() -> None:
    kalman = KalmanFilter(ARM, delay=DELAY, noise=NOISE)
    tables = FilterTables.along(kalman, [plan()])
    random = np.random.default_rng(0)
    estimate = kalman.start(plan().states[:1])
    mean = estimate.mean
    for k in range(20):
        at = np.zeros(1, dtype=int), np.array([k])
        readings = tables.nominal[at][:, tables.rows] + 1e-6 * random.normal(size=(1, 6))
        estimate, _ = kalman.correct(estimate, Readings(readings[:, :4], readings[:, 4:]))
        mean = mean + product(tables.gain[at], tables.residual(mean, readings))
        torque = plan().torques[k : k + 1] + 1e-4 * random.normal(size=(1, 2))
        estimate, mean = kalman.predict(estimate, torque), tables.predict(at, mean, torque, torque, np.zeros((1, 1)))
    assert isinstance(estimate, Estimate)
    off = estimate.mean - tables.nominal[:, 20]
    np.testing.assert_allclose(mean - tables.nominal[:, 20], off, atol=1e-3 * np.abs(off).max())


def test_it_brings_the_arm_back_almost_as_the_true_state_does() -> None:
    weights, start = RegulatorWeights(torque=(6.0, 2.0)), np.tile(START, (4, 1))
    start[:, :2] += 0.02 * np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]])
    off = off_plan(LQG(task(), [plan()], weights=weights), Plant(start), plan())
    true = PlanRegulator(plan(), weights).rollout(start).states[:, 1:-1] - plan().states[1:-1]
    late = slice(20, None)
    assert np.sqrt(np.mean(off[late, :, :2] ** 2)) < 1.2 * np.sqrt(np.mean(true[:, late, :2] ** 2)) + 1e-3


def test_parts() -> None:
    whole = LQG(task(), [plan()])
    assert LQG(task(), [plan()], delay=DELAY).filter.nominal.tolist() == whole.filter.nominal.tolist()
    assert LQG(task(), [plan()], delay="ignored").filter.nominal.shape[-1] == SIZE + 2
    assert not LQG(task(), [plan()], feed_forward=False).regulator.torque.any()
    assert LQG(task(), [plan()], integral=0.01).regulator.gain[..., -2:].any()
    assert not whole.regulator.gain[..., SIZE:].any()
    late = LQG(replace(task(), actuation_delay=0.004), [plan()])
    assert late.late == pytest.approx(0.4)
    assert late.regulator.gain[..., SIZE:].any()
    heavy = LQG(task(), [plan()], model=FlexibleArm(replace(ARM.parameters, payload_mass=0.3)))
    assert np.abs(heavy.filter.after[..., :SIZE] - plan().states[1:]).max() > 1e-3
    assert np.abs(whole.filter.after[..., :SIZE] - plan().states[1:]).max() < 1e-9


def test_integral_action_takes_away_a_steady_error() -> None:
    """A payload bends nothing that stands still, a wrong reading of the tip does: its integral grows."""
    controller = LQG(task(), [plan()], integral=0.01)
    observation = Plant(START[None]).observe()
    observation[:, 4:6] += 0.05
    _, state = controller.predict(observation)
    assert state[3] == pytest.approx(np.full((1, 2), 0.05 * 0.01))


test_refusals = refused(
    (lambda: LQG(task(), [plan()], delay="late"), "delay = 'late': must be one of"),  # type: ignore[arg-type]
    (lambda: LQG(replace(task(), sensor="collocated"), [plan()]), "sensor = 'collocated': must be 'true'"),
    (
        lambda: LQG(task(), [plan()], model=FlexibleArm(replace(ARM.parameters, modes_per_link=2))),
        r"plans\[0\]: must have 2 modes of each link, has 1",
    ),
    (lambda: LQG(task(), [plan()], integral=0.0), r"integral = 0\.0.*must be a finite number and > 0"),
    (lambda: LQG(replace(task(), actuation_delay=0.02), [plan()]), r"actuation_delay = 0\.02 s: .* 0\.01 s, at most"),
    (
        lambda: GaugedLQG(replace(task(), blocks={name: BLOCKS[name] for name in PLACES}), [plan()]),
        r"GaugedLQG reads the block 'modal_coordinates'.*GaugedLQG\.options",
    ),
    (lambda: learned(plan(), lap_of(plan(), (0.0, 0.0))._replace(tip=START), plan().reference), "tip: must have shape"),
)


@pytest.mark.parametrize("direction", ["clockwise", "counterclockwise"])
def test_it_is_as_good_as_the_true_state_at_the_start_of_both_laps(direction: str) -> None:
    errors = []
    for kind in (LQG, PlanFollower):
        env = gymnasium.make(ID, direction=direction, **kind.options())
        controller = kind.for_env(env)
        runs = [run_policy(env, controller, lap=lap, max_steps=60) for lap in LAPS]
        errors.append([np.linalg.norm(run.tip - run.reference, axis=1) for run in runs])
    np.testing.assert_allclose(*errors, atol=0.01)


@pytest.fixture(scope="module")
def inertial() -> InertialLQG:
    return InertialLQG.for_env(gymnasium.make(ID, **InertialLQG.options()))


def test_its_model_of_the_imu_is_the_sensor() -> None:
    """Within the range, a reading is the specific force of the state under the torque that has been held."""
    env = gymnasium.make(ID, **InertialLQG.options() | {"imu_noise": (0.0, 0.0), "imu_range": (1e5, 1e3)})
    env.reset(seed=0)
    for action in np.random.default_rng(0).uniform(-1.0, 1.0, (5, 2)).astype(np.float32):
        *_, info = env.step(action)
        torque = action.astype(np.float64) * [150.0, 50.0]
        found = inertial_reading(env.unwrapped.settings.flexible_arm, info["state"], torque)
        np.testing.assert_allclose(found, info["imu"], rtol=1e-6)


def test_its_derivatives_predict_other_readings(inertial: InertialLQG) -> None:
    arm, plan = inertial.plans[0].arm, inertial.plans[0]
    random = np.random.default_rng(0)
    change, push = 1e-4 * random.normal(size=plan.states.shape[1]), 0.1 * random.normal(size=2)
    state, torque = plan.states[300], plan.torques[299]
    value, by_state, by_torque = readings_along(arm, state, torque)
    found = inertial_reading(arm, state + change, torque + push)
    np.testing.assert_allclose(value + by_state @ change + by_torque @ push, found, atol=1e-3 * np.abs(found).max())


def test_the_trust_in_the_accelerometer_is_its_spread_over_the_published_arms(inertial: InertialLQG) -> None:
    box = {name: UNKNOWN_PLANT["randomisation"][name] for name in ("payload_mass", "stiffness", "damping")}
    low, high = np.array(list(box.values())).T
    states = np.stack([plan.states[:-1] for plan in inertial.plans])
    squares = []
    for payload, stiffness, damping in low + (high - low) * qmc.Sobol(3, seed=0).random(16):
        rigid = tuple(stiffness * one for one in inertial.task.arm.flexural_rigidities)
        arm = replace(inertial.task.arm, payload_mass=payload, flexural_rigidities=rigid, damping_ratio=damping)
        read = inertial_reading(FlexibleArm(arm), states, inertial.before)
        squares.append((read - inertial.expected) ** 2)
    spread = np.sqrt(np.mean(squares, axis=(0, 1, 2)))
    assert spread[:2] == pytest.approx(TRUST[:2], rel=0.15)  # another sample of the box gives other digits
    assert spread[2] < 1e-9  # the tangent's rate depends on no mass


@pytest.mark.parametrize("other", [{"imu_position": 2.0}, {"imu_delay": 0.01}, {"imu_link": 1}], ids=list)
def test_an_imu_elsewhere_is_refused(other: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=f"{next(iter(other))} = .*must be at the tip of link 2, and not late"):
        InertialLQG.for_env(gymnasium.make(ID, **InertialLQG.options() | other))


@pytest.mark.parametrize(
    "design", [{}, {"delay": "ignored"}, {"model": FlexibleArm(replace(ARM.parameters, payload_mass=0.3))}], ids=list
)
def test_with_an_imu_too_it_is_designed_for_what_is_given(design: dict[str, Any]) -> None:
    """The gains are those of LQG where the IMU is not trusted, whatever model and delay."""
    own = replace(task(), blocks=BLOCKS | {"accelerometer": slice(0, 2), "gyro": slice(2, 3)})
    deaf, plain = InertialLQG(own, [plan()], trust=(1e9, 1e9, 1e9), **design), LQG(own, [plan()], **design)
    assert np.abs(deaf.gain).max() < 1e-6 < 1e-3 < np.abs(InertialLQG(own, [plan()], **design).gain).max()
    np.testing.assert_allclose(deaf.filter.gain, plain.filter.gain, atol=1e-6 * np.abs(plain.filter.gain).max())


def lap_of(now: Plan, disturbance: tuple[float, float], **quantities: float) -> Lap:
    """Drive the arm by a plan's torques, with a disturbance that no sensor sees."""
    states = ARM.rollout(START, now.torques + disturbance, **quantities).states
    return Lap(states, now.torques, ARM.tip(states[:, :4]))


@pytest.mark.parametrize(("disturbance", "payload"), [((3.0, -1.0), 0.0), ((0.0, 0.0), 0.2)])
def test_what_repeats_is_learned(disturbance: tuple[float, float], payload: float) -> None:
    """Each lap leaves a smaller error, whether the torques are disturbed or the arm is another."""
    now, target, errors = plan(), ARM.tip(plan().states[:, :4]), []
    for _ in range(6):
        lap = lap_of(now, disturbance, payload_mass=payload)
        errors.append(np.linalg.norm(lap.tip - target))
        now = learned(now, lap, target)
    assert all(after < before for before, after in zip(errors[:-1], errors[1:], strict=True))
    assert errors[-1] < 0.2 * errors[0]


def test_without_an_error_the_next_lap_is_the_last() -> None:
    lap = lap_of(plan(), (3.0, -1.0))
    after = learned(plan(), lap, lap.tip)
    np.testing.assert_allclose(after.torques, lap.torques)
    np.testing.assert_allclose(after.states, lap.states)


def test_the_prediction_is_what_the_model_then_does() -> None:
    """To first order: a tenth of the error leaves a hundredth of the difference."""
    off = []
    for share in (1.0, 0.1):
        lap = lap_of(plan(), (0.0, 0.0))
        after = learned(plan(), lap, lap.tip + share * np.linspace(0.0, 0.05, len(lap.tip))[:, None])
        off.append(np.abs(lap_of(after, (0.0, 0.0)).states - after.states).max())
    assert 0.0 < off[1] < 0.03 * off[0]
