"""LQG that finds out what the arm, the sensor and the motors are: its plans, its two filters, and a run."""

import gymnasium
import numpy as np
import pytest

from flexarm_baselines.lqg import LQG, QUICK, AdaptiveLQG, nodes
from flexarm_baselines.lqg.adaptive import Beliefs, least_in_doubt
from flexarm_baselines.lqg.nodes import BEND, Node, grid
from flexarm_baselines.lqg.tables import FilterTables
from flexarm_baselines.observers import KalmanFilter
from flexarm_baselines.optimal import GOOD
from flexarm_env.envs.registration import UNKNOWN_PLANT
from tests.support.late_arm import ARM, SIZE, START, Plant, plan, task

PERIODS = 160
TASK, PLAN = task(PERIODS), plan(PERIODS)


def test_the_plan_for_another_arm_is_its_motion_along_the_same_way() -> None:
    nodes = grid(PLAN, ARM, (0.0, 0.3), (0.8, 1.0), GOOD)
    assert [node.values.tolist() for node in nodes] == [[0.0, 0.8], [0.0, 1.0], [0.3, 0.8], [0.3, 1.0]]
    assert np.array_equal(nodes[1].plan.states, PLAN.states)
    found = nodes[2].plan
    other = {"payload_mass": 0.3, "stiffness": 0.8}
    np.testing.assert_allclose(ARM.rollout(START, found.torques[:30], **other).states, found.states[:31], atol=1e-6)
    as_planned = ARM.rollout(START, PLAN.torques, **other)
    off, idle = (
        np.sqrt(np.mean(np.sum((ARM.tip(states[:, :4]) - ARM.tip(PLAN.states[:, :4])) ** 2, axis=1)))
        for states in (found.states, as_planned.states)
    )
    assert off < 0.2 * idle


def test_a_plan_is_eased_where_links_bend_far(monkeypatch: pytest.MonkeyPatch) -> None:
    """Far is brought near, so that a plan of 1.6 s is enough; the tip stays close to its way."""
    bends = ARM.modes[0].tip_values
    most = np.abs(PLAN.states[:, 2:3] @ bends).max()
    assert most < BEND
    monkeypatch.setattr(nodes, "BEND", 0.7 * most)
    monkeypatch.setattr(nodes, "EXCESS", 0.05 * most)
    node = Node.of(np.array([0.0, 1.0]), PLAN, ARM, GOOD)
    eased = node.eased(ARM, GOOD)
    assert np.abs(eased.plan.states[:, 2:3] @ bends).max() < 0.8 * most
    off = ARM.tip(eased.plan.states[:, :4]) - ARM.tip(PLAN.states[:, :4])
    assert 0.0 < np.sqrt(np.mean(off**2)) < 0.02


def test_another_hypothesis_is_believed_if_it_is_clearly_less_in_doubt() -> None:
    doubt = np.array([[20.0, 15.0, 30.0], [20.0, 9.0, 8.0], [20.0, 9.0, 8.0]])
    assert least_in_doubt(doubt, np.array([0, 0, 1])).tolist() == [0, 2, 1]


def test_lateness_and_what_it_changes() -> None:
    """Torques that act late by nothing, a half, or all of a period are exact; the slope is the derivative between."""
    tables = FilterTables.along(KalmanFilter(ARM, delay=0.0234), [PLAN])
    at, before, torque = (np.zeros(1, dtype=int), np.array([20])), np.array([[3.0, -1.0]]), np.array([[-4.0, 2.0]])
    estimate = tables.nominal[at]

    def later(share: float) -> np.ndarray:
        return tables.predict(at, estimate, before, torque, np.full((1, 1), share))

    for share in (0.0, 0.5, 1.0):
        state = PLAN.states[20]
        for part, acting in ((share, before[0]), (1.0 - share, torque[0])):
            state = state if part == 0.0 else ARM.step(state, acting, 0.01 * part)
        change = state - PLAN.states[21]
        np.testing.assert_allclose(later(share)[0, :SIZE] - PLAN.states[21], change, atol=0.05 * np.abs(change).max())
    slope = tables.by_lateness(at, np.zeros_like(estimate), before, torque, np.full((1, 1), 0.3))
    np.testing.assert_allclose(slope, (later(0.31) - later(0.29)) / 0.02, atol=1e-9)


def test_it_finds_out_and_stays_closer_than_one_that_does_not() -> None:
    errors = []
    for controller in (
        LQG(TASK, [PLAN], weights=GOOD, noise=QUICK),
        AdaptiveLQG(TASK, [PLAN], payloads=(0.0, 0.3), stiffnesses=(0.8, 1.0)),
    ):
        plant, state, off = Plant(np.tile(START, (2, 1)), 0.0234, PERIODS, payload_mass=0.3, stiffness=0.8), None, []
        for _ in range(PERIODS - 1):
            action, state = controller.predict(plant.observe(), state)
            plant.step(action)
            off.append(ARM.tip(plant.states[:, :4]) - ARM.tip(PLAN.states[plant.period, :4]))
        errors.append(np.sqrt(np.mean(np.sum(np.square(off[80:]), axis=-1))))
    assert state is not None
    beliefs, believed = Beliefs(*state[:4]), (np.arange(2), state[-2])
    estimate, late = beliefs.estimate[believed], beliefs.late[believed]
    assert estimate[:, SIZE] == pytest.approx([0.3, 0.3], abs=0.05)
    assert estimate[:, SIZE + 1] == pytest.approx([0.8, 0.8], abs=0.05)
    assert estimate[:, SIZE + 3] == pytest.approx([0.0234, 0.0234], abs=3e-3)
    assert (late < 4e-3).all()  # where it began; these motors are not late
    assert errors[1] < 0.5 * errors[0]


@pytest.mark.slow
def test_the_unknown_plant_is_kept_on_the_path() -> None:
    options = AdaptiveLQG.options() | UNKNOWN_PLANT
    envs = gymnasium.make_vec("flexarm_env:FlexArm/Square-v0", num_envs=32, **options)
    controller, sides = AdaptiveLQG.for_env(envs), ["positive", "negative"] * 16
    observations, infos = envs.reset(seed=0, options={"start": "corner", "elbow_branch": sides})
    state, lost = None, np.zeros(32, dtype=bool)
    for _ in range(300):
        actions, state = controller.predict(observations, state)
        observations, _, terminated, _, infos = envs.step(actions)
        lost |= terminated
    assert not lost.any()
    assert np.median(infos["tip_error"]) < 0.02
