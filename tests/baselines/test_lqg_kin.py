"""LQG's kin: the H-infinity controller with its guarantee, and the filters that find out what arm and sensor are."""

from dataclasses import replace
from functools import cache, partial

import gymnasium
import numpy as np
import pytest

from flexarm_baselines.lqg import LQG, QUICK, AdaptiveLQG, StampedLQG, adaptive, hinf, nodes
from flexarm_baselines.lqg.adaptive import Beliefs, Hypothesis, least_in_doubt
from flexarm_baselines.lqg.hinf import Game, HInfinityLQG, Solution, least_gamma
from flexarm_baselines.lqg.imu import InertialLQG
from flexarm_baselines.lqg.nodes import BEND, Node, grid
from flexarm_baselines.lqg.tables import FilterTables
from flexarm_baselines.observers import KalmanFilter, NoiseModel
from flexarm_baselines.optimal import GOOD, Plan, RegulatorWeights
from flexarm_baselines.task import Task
from flexarm_env.envs.registration import UNKNOWN_PLANT
from tests.support.late_arm import ARM, BLOCKS, SIZE, START, Plant, plan, task
from tests.support.refusals import refused

WEIGHTS = RegulatorWeights(tip=0.01, speed=0.3, torque=(6.0, 2.0))
NOISE = NoiseModel(
    joint_angle=0.01, joint_rate=0.3, tip=0.01, torque=(10.0, 4.0), start_joint=1e-4, start_mode=1e-4, start_rate=1e-4
)


@cache
def game() -> Game:
    return Game.of(task(), [plan()], WEIGHTS, NOISE)


def root(matrix: np.ndarray) -> np.ndarray:
    values, vectors = np.linalg.eigh(matrix)
    return vectors * np.sqrt(np.maximum(values, 0.0))


def gain(one: Game, solution: Solution) -> float:
    """Largest ratio of weighed deviations and torques to weighed disturbances: the norm of the map between them."""
    size, periods = one.kalman.size, one.cost.shape[1]
    rows, deviations = one.kalman.sensors()
    shares = [size, *[size, len(rows)] * periods]  # start, then noise on the plant and on the readings
    inputs = np.split(np.eye(sum(shares)), np.cumsum(shares)[:-1])
    z, estimate, outputs = root(one.start[0]) @ inputs[0], np.zeros((size, sum(shares))), []
    for k in range(periods):
        by_torque, matrix = one.along.by_torque[0, k], one.along.matrix[0, k]
        read = z[rows] + deviations[:, None] * inputs[2 + 2 * k]
        estimate = estimate + solution.correction[0, k] @ (read - estimate[rows])
        torque = solution.regulator[0, k] @ estimate
        outputs += [root(one.cost[0, k]).T @ z, np.sqrt(one.effort) @ torque]
        z = matrix @ z + by_torque @ torque + root(one.noise[0, k]) @ inputs[1 + 2 * k]
        estimate = matrix @ (estimate + solution.pull[0, k] @ estimate) + by_torque @ torque
    return float(np.linalg.norm(np.concatenate([*outputs, root(one.cost[0, -1]).T @ z]), 2))


def with_changes() -> Task:
    return replace(task(), payloads=np.zeros(len(plan().torques)))


test_refusals = refused(
    (lambda: HInfinityLQG(with_changes(), [plan()]), "payload_changes"),
    (lambda: InertialLQG(with_changes(), [plan()]), "payload_changes"),
    (lambda: AdaptiveLQG(replace(task(), sensor="rigid"), [plan()]), "sensor = 'rigid': must be 'true'"),
    (lambda: HInfinityLQG(replace(task(), actuation_delay=0.01), [plan()]), r"actuation_delay = 0\.01 s"),
    (lambda: AdaptiveLQG(replace(task(), actuation_delay=0.02), [plan()]), r"actuation_delay = 0\.02 s: .* at most"),
    (lambda: AdaptiveLQG(task(), [plan()], late=0.02), r"late = 0\.02: must be .*<= 0\.01 \[s\]"),
    (lambda: AdaptiveLQG(task(), [plan()], payloads=()), r"payloads = \(\): must hold a value"),
    (lambda: AdaptiveLQG(task(), [plan()], stiffnesses=(1.0, 0.0)), r"stiffnesses\[1\] = 0\.0"),
    (lambda: least_gamma(game(), high=2.0), r"low = 1\.0, high = 2\.0: a controller must guarantee high"),
    (lambda: least_gamma(game(), low=1e4), r"low = 10000\.0, high = 100000\.0: a controller must"),
    (lambda: HInfinityLQG(task(), [plan()], gamma=1e-6), r"gamma = 1e-06: no controller guarantees it"),
)


def test_gamma_is_guaranteed_and_the_least_one_is_tight(monkeypatch: pytest.MonkeyPatch) -> None:
    """The gain from disturbances to costs is below gamma, and close to the least one that can be guaranteed."""
    monkeypatch.setattr(hinf, "ENDURING", 0.0)  # the game ends with the plan, as the sum of the costs does
    one = game()
    least = least_gamma(one)
    best, quadratic = one.solved(least), one.solved(1e6)
    assert best is not None
    assert quadratic is not None
    assert one.solved(0.97 * least) is None
    assert 0.9 * least < gain(one, best) < least
    assert gain(one, quadratic) > 1.02 * least  # LQG is best on average, not in the worst case
    loose = one.solved(1.3 * least)
    assert loose is not None
    assert gain(one, loose) < 1.3 * least


def test_with_a_large_gamma_it_is_lqg() -> None:
    found, known = HInfinityLQG(task(), [plan()], gamma=1e5, noise=hinf.NOISE), LQG(task(), [plan()])
    regulator, size = known.regulator.gain[0], known.filter.matrix.shape[-1]
    scale = np.abs(regulator).max()
    # The cost at the very end is another.
    np.testing.assert_allclose(found.solution.regulator[0, ..., :size], regulator[..., :size], atol=0.01 * scale)
    np.testing.assert_allclose(found.solution.correction, known.filter.gain, atol=1e-5)
    assert np.abs(found.solution.pull).max() < 1e-3


@pytest.mark.slow  # for the whole lap; the game itself is tested above
def test_the_shipped_gamma_is_a_tenth_above_the_least() -> None:
    env = gymnasium.make("flexarm_env:FlexArm/Square-v0", **HInfinityLQG.options())
    own = Task.of(env)
    shipped = Game.of(own, LQG(own).plans, hinf.WEIGHTS, hinf.KNOWN)
    assert shipped.solved(hinf.GAMMA / 1.15) is None
    assert shipped.solved(hinf.GAMMA / 1.05) is not None


# --- LQG that finds out what the arm, the sensor and the motors are --------------------------------------------------


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
        plant, off = Plant(np.tile(START, (2, 1)), 0.0234, PERIODS, payload_mass=0.3, stiffness=0.8), []
        for _, state in plant.driven(controller, PERIODS - 1):  # noqa: B007
            off.append(ARM.tip(plant.states[:, :4]) - ARM.tip(PLAN.states[plant.period, :4]))
        errors.append(np.sqrt(np.mean(np.sum(np.square(off[80:]), axis=-1))))
    beliefs, believed = Beliefs(*state[:4]), (np.arange(2), state[-2])
    estimate, late = beliefs.estimate[believed], beliefs.late[believed]
    assert estimate[:, SIZE] == pytest.approx([0.3, 0.3], abs=0.05)
    assert estimate[:, SIZE + 1] == pytest.approx([0.8, 0.8], abs=0.05)
    assert estimate[:, SIZE + 3] == pytest.approx([0.0234, 0.0234], abs=3e-3)
    assert (late < 4e-3).all()  # where it began; these motors are not late
    assert errors[1] < 0.5 * errors[0]


def test_motors_are_late_by_a_period_at_most(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where periods are shorter than what the design, the hypotheses and the estimates have by default."""
    own = replace(task(), period=0.002)
    torques = np.zeros((own.periods, 2))
    run = ARM.rollout(START, torques, period=own.period)
    at_rest = Plan(ARM.parameters, run.states, torques, own.reference, own.torque_limit, own.period, 1e-3)
    made, plant = partial(AdaptiveLQG, own, [at_rest], payloads=(0.0,), stiffnesses=(1.0,)), Plant(START[None])
    controller = made()
    assert controller.regulator is made(late=own.period).regulator
    monkeypatch.setattr(adaptive, "HYPOTHESES", (Hypothesis(0.3, 0.9, 4e-3), Hypothesis(0.3, 0.9, 1.9999e-3)))
    state, late = None, []
    for _ in range(20):
        _, state = controller.predict(plant.observe(), state)
        late.append(Beliefs(*state[:4]).late[0])
        plant.states = plant.states + np.array([0.0, 0.0, 0.0, 0.0, 0.3, -0.5, 0.0, 0.0])  # as no motors move it
    assert late[0][0] == own.period
    assert 0.0 <= np.min(late) < np.max(np.array(late)[:, 1]) == own.period


def test_equal_tasks_share_a_design_and_others_do_not() -> None:
    few = {"payloads": (0.0, 0.1), "stiffnesses": (1.0,)}
    anew = replace(plan(), states=plan().states.copy(), notes={"another": "object"})
    first, again = (AdaptiveLQG(replace(task()), [one], **few) for one in (plan(), anew))
    assert again.filter is first.filter
    assert again.regulator is first.regulator
    assert again.plans[0] is anew
    with pytest.raises(ValueError, match="read-only"):
        first.filter.gain[:] = 0.0
    stamped = StampedLQG(replace(task(), blocks=BLOCKS | {"reading_age": slice(0, 1)}), [plan()], **few)
    assert stamped.regulator is first.regulator
    assert not np.array_equal(stamped.filter.gain, first.filter.gain)
    anew.states[:, 0] += 0.1
    assert not np.array_equal(AdaptiveLQG(task(), [anew], **few).filter.nominal, first.filter.nominal)


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
