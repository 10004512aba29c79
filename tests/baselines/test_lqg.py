"""LQG along a plan: its tables beside the filter and the regulator that they stand for, and runs on a small arm."""

from dataclasses import replace

import gymnasium
import numpy as np
import pytest

from flexarm_baselines.arrays import product
from flexarm_baselines.lqg import LQG, NOISE, GaugedLQG
from flexarm_baselines.lqg.tables import FilterTables
from flexarm_baselines.observers import Estimate, KalmanFilter, Readings
from flexarm_baselines.optimal import PlanRegulator, RegulatorWeights
from flexarm_baselines.optimal.library import mirrored
from flexarm_baselines.plan_follower import PlanFollower
from flexarm_env import FlexibleArm
from flexarm_env.rollout import run_policy
from tests.support.late_arm import ARM, BLOCKS, DELAY, PLACES, SIZE, START, Plant, off_plan, plan, task


@pytest.mark.parametrize("kind", [LQG, GaugedLQG])
def test_on_the_plan_it_replays_the_plan(kind: type[LQG]) -> None:
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


def test_refusals() -> None:
    with pytest.raises(ValueError, match="delay = 'late': must be one of"):
        LQG(task(), [plan()], delay="late")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=r"integral = 0\.0.*must be a finite number and > 0"):
        LQG(task(), [plan()], integral=0.0)
    with pytest.raises(ValueError, match=r"actuation_delay = 0\.02 s: must be a control period, 0\.01 s, at most"):
        LQG(replace(task(), actuation_delay=0.02), [plan()])
    with pytest.raises(ValueError, match=r"GaugedLQG reads the block 'modal_coordinates'.*GaugedLQG\.options"):
        GaugedLQG(replace(task(), blocks={name: BLOCKS[name] for name in PLACES}), [plan()])


@pytest.mark.parametrize("direction", ["clockwise", "counterclockwise"])
def test_it_is_as_good_as_the_true_state_at_the_start_of_both_laps(direction: str) -> None:
    for lap in ("swing", "plain"):
        errors = []
        for kind in (LQG, PlanFollower):
            env = gymnasium.make("flexarm_env:FlexArm/Square-v0", direction=direction, **kind.options())
            run = run_policy(env, kind.for_env(env), lap=lap, max_steps=60)
            errors.append(np.linalg.norm(run.tip - run.reference, axis=1))
        np.testing.assert_allclose(errors[0], errors[1], atol=0.01)
