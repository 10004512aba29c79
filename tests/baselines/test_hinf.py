"""The H-infinity controller: its guarantee beside the gain of the closed loop, and LQG where gamma is large."""

from functools import cache

import gymnasium
import numpy as np
import pytest

from flexarm_baselines.lqg import LQG, hinf
from flexarm_baselines.lqg.hinf import Game, HInfinityLQG, Solution, least_gamma
from flexarm_baselines.observers import NoiseModel
from flexarm_baselines.optimal import RegulatorWeights
from flexarm_baselines.task import Task
from flexarm_env import FlexibleArm
from tests.support.late_arm import ARM, START, Plant, off_plan, plan, task

WEIGHTS = RegulatorWeights(tip=0.01, speed=0.3, torque=(6.0, 2.0))
NOISE = NoiseModel(
    joint_angle=0.01, joint_rate=0.3, tip=0.01, torque=(10.0, 4.0), start_joint=1e-4, start_mode=1e-4, start_rate=1e-4
)


@cache
def game() -> Game:
    return Game.of(task(), [plan()], ARM, WEIGHTS, NOISE)


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


def test_the_shipped_gamma_is_a_tenth_above_the_least() -> None:
    env = gymnasium.make("flexarm_env:FlexArm/Square-v0", **HInfinityLQG.options())
    own = Task.of(env)
    shipped = Game.of(own, LQG(own).plans, FlexibleArm(own.arm), hinf.WEIGHTS, hinf.KNOWN)
    assert shipped.solved(hinf.GAMMA / 1.15) is None
    assert shipped.solved(hinf.GAMMA / 1.05) is not None


def test_on_the_plan_it_replays_the_plan_and_refuses_a_gamma_without_a_controller() -> None:
    off = off_plan(HInfinityLQG(task(), [plan()], gamma=1e3), Plant(np.tile(START, (2, 1))), plan())
    assert np.abs(off).max() < 2e-3  # as LQG
    with pytest.raises(ValueError, match=r"gamma = 1e-06: no controller guarantees it"):
        HInfinityLQG(task(), [plan()], gamma=1e-6)
