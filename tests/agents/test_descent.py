"""First-order gradients: the chain rule through arm, sensor and network beside differences of real runs; trainings."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from stable_baselines3.common.logger import Logger

from flexarm_agents import FOPGConfig, config_of
from flexarm_agents.descent.adjoint import output_gradients, seen_in
from flexarm_agents.descent.observations import Observations
from flexarm_agents.descent.training import FOPGTraining
from flexarm_agents.descent.window import Driver, Window, costs, error_cost, largest_cost
from flexarm_agents.environments import make_batch
from flexarm_agents.training.run_folder import RunFolder
from flexarm_env.envs.blocks import BLOCKS
from flexarm_env.envs.settings import Settings
from tests.support.envs import OF_FURTHER_SENSORS
from tests.support.trainings import DESCENDED, row

Floats = NDArray[np.float64]
ID = "FlexArm/Square-v0"
ELSEWHERE = ("torque", "inner_gain", *OF_FURTHER_SENSORS)  # with other options
OPEN_LOOP = ("time", "episode_parameters")  # on which an action has no influence
OBSERVATION = [name for name in BLOCKS if name not in (*ELSEWHERE, *OPEN_LOOP)]
OPTIONS: dict[str, Any] = {"observation": OBSERVATION, "last_actions": 3}
LAP: dict[str, Any] = {"start": "corner", "elbow_branch": "negative"}


class Chain:
    """A window of a linear policy in double precision, and the derivatives of its costs and of a linear value after it.

    The environment's own observations and actions are in single precision.
    """

    periods, arms = 18, 4

    def __init__(self, **options: Any) -> None:
        sizes: dict[str, Any] = {"horizon": self.periods, "arms": self.arms, "episode_steps": 13}
        given = {"options": {**OPTIONS, **options}, "curriculum_options": {"start": "moving"}}
        self.config = FOPGConfig(**sizes, **given, deflection_share=0.01)
        self.env = make_batch(ID, self.arms, self.config.batch_options)
        self.model = Observations(self.env)
        random, size = np.random.default_rng(0), len(self.model.scale)
        self.weights = 0.03 * random.normal(size=(2, size))
        self.value = random.normal(size=size)
        self.wishes = np.array([[1.5, 0.1], [-0.2, -1.4], [0.3, -0.3], [0.0, 0.2]])  # of each arm; some are too large
        self.discounts = 0.95 ** np.arange(self.periods)[:, None] * np.ones((1, self.arms))

    def window(self, weights: Floats) -> Window:
        return Driver(self.env, 3, 0.1).window(
            lambda seen: seen.astype(np.float64) @ weights.T + self.wishes, self.periods
        )

    def total(self, weights: Floats) -> float:
        window = self.window(weights)
        found = costs(window, self.env.settings, self.config)
        after = np.where(window.ended[-1], 0.0, window.last[-1].astype(np.float64) @ self.value)
        return float((self.discounts * found.total).sum() + after.sum())

    def gradient(self) -> Floats:
        window = self.window(self.weights)
        assert window.ended.any()
        assert not window.ended[-1].any()
        assert (np.abs(window.output) > 1.0).any()
        found = costs(window, self.env.settings, self.config)
        network = np.broadcast_to(self.weights, (self.periods, self.arms, *self.weights.shape))
        at_end = np.tile(self.value, (self.arms, 1))
        by_output = output_gradients(self.model, window, found, network, at_end, self.discounts)
        return np.einsum("tni,tnk->ik", by_output, window.observations[:-1].astype(np.float64))


GIVEN = [*({"delay": x} for x in (None, 0.0, 0.004, 0.02, 0.0437)), {"frame": "world"}]
GIVEN.append({"frame": "world", "scaled": False})


@pytest.mark.parametrize("options", GIVEN, ids=str)
def test_the_gradient_is_that_of_the_environment(options: dict[str, Any]) -> None:
    """Network's weights to costs: by differences of runs of the very environment, block by block."""
    chain, step = Chain(**options), 3e-4
    blocks = chain.env.observation_blocks
    if "scaled" in options:
        chain.weights, step, blocks = 0.2 * chain.weights, 1e-4, {"all": slice(None)}
    gradient = chain.gradient()
    for name, place in blocks.items():
        if name == "reading_age" and options.get("delay") == 0.0:
            assert not gradient[:, place].any()  # the block is 0
            continue
        way = np.zeros_like(gradient)
        way[:, place] = gradient[:, place] / np.linalg.norm(gradient[:, place])
        difference = chain.total(chain.weights + step * way) - chain.total(chain.weights - step * way)
        assert difference / (2.0 * step) == pytest.approx((gradient * way).sum(), rel=3e-3), name
    chain.env.close()


@pytest.mark.parametrize("frame", ["link", "world"])
def test_observations_are_those_of_the_environment(frame: str) -> None:
    """What the task decides is recovered from one arm's observations and completes those of another arm."""
    seen_of_task = {"observation": [*OBSERVATION, *OPEN_LOOP], "frame": frame}
    env = make_batch(ID, 2, {**OPTIONS, **seen_of_task, **LAP, "max_episode_steps": 100})
    window = Driver(env, 0).window(lambda seen: np.array([[0.4, -0.2], [-0.3, 0.5]]), 14)
    model, seen = Observations(env), seen_in(window, 3)
    task = model.task(window.observations, seen)
    swapped = type(task)(*(part[:, ::-1] for part in task))
    known = slice(5, None)  # of the first readings, those before the episode are not in the window
    found = model.values(seen, swapped)[known]
    assert np.abs(np.diff(window.observations[known], axis=1)).max(axis=(0, 1)).min() == 0.0  # the task's own numbers
    np.testing.assert_allclose(found, window.observations[known], atol=3e-6)
    env.close()


def test_episodes_begin_one_after_the_other() -> None:
    env = make_batch(ID, 4, {**LAP, "max_episode_steps": 100})
    driver = Driver(env, 0, 0.1)
    driver.stagger(20)
    window = driver.window(lambda seen: np.zeros((4, 2)), 1)
    np.testing.assert_array_equal(window.ages[0], [20, 15, 10, 5])
    assert np.unique(window.states[0], axis=0).shape[0] == 4
    np.testing.assert_array_equal(window.earlier != 0.0, True)
    env.close()


@pytest.mark.parametrize("torque", [1e4, 1e8])
def test_arms_that_fly_apart_are_left_out(tmp_path: Path, torque: float) -> None:
    """Neither their states nor their derivatives are numbers."""
    options = {"torque_limit": [torque, torque], "deflection_limit": None, "error_limit": None}
    config = FOPGConfig(arms=4, horizon=8, episode_steps=20, torque_noise=1.0, hidden=(8,), options=options)
    training = FOPGTraining(config, RunFolder(tmp_path))
    training.start()
    figures = [training.window() for _ in range(3)]
    training.driver.env.close()
    assert min(one.lost for one in figures) > 0
    assert np.isfinite(figures).all()
    assert all(np.isfinite(weight).all() for weight in training.policy().weights)


def test_the_cost_of_an_error_is_a_square_and_then_a_line() -> None:
    squares = np.array([1e-6, 0.04, 25.0])
    cost, slope = error_cost(squares, 0.2)
    np.testing.assert_allclose(cost[[0, 2]], [1e-6 / 0.4, 5.0 - 0.2], rtol=1e-3)
    np.testing.assert_allclose((error_cost(squares + 1e-7, 0.2)[0] - cost) / 1e-7, slope, rtol=1e-3)
    farther = error_cost(np.array(2.5**2), 0.3)[0]
    assert largest_cost(Settings(), FOPGConfig(error_knee=0.3)) == pytest.approx(float(farther))
    assert largest_cost(Settings(error_limit=None), FOPGConfig(error_knee=0.3)) == pytest.approx(17.7, rel=1e-2)


def test_what_the_critic_alone_sees_comes_last() -> None:
    late = {"observation": ["joint_error", "sensor_error"]}
    seen = [*late["observation"], "modal_coordinates", "modal_rates"]
    assert FOPGConfig(options=late).batch_options["observation"] == seen
    assert FOPGConfig(options=late, critic_epochs=0).batch_options["observation"] == late["observation"]


def test_the_first_third_of_a_second_is_learned_at_once(tmp_path: Path) -> None:
    """A training for real, though a small one: every window is the lap's beginning."""
    sizes: dict[str, Any] = {"arms": 2, "episode_steps": 32, "hidden": (32,), "critic_epochs": 0, "torque_noise": 0.0}
    config = FOPGConfig(windows=40, rounds=1, candidates=1, curriculum_options=LAP, **sizes)
    training = FOPGTraining(config, RunFolder(tmp_path))
    training.start()
    figures = [training.window() for _ in range(40)]
    training.driver.env.close()
    assert figures[-1].error < 0.35 * figures[0].error


@pytest.mark.parametrize(
    ("errors", "best"), [([0.3, 0.1, 0.2], 1), ([0.1, 0.1, 0.2], 0), ([None, 0.4, 0.3], 2), ([0.4, None, None], 0)]
)
def test_the_best_candidate_goes_on(errors: list[float | None], best: int, tmp_path: Path) -> None:
    """By the evaluation after its trial; it goes on where it was, in its own episodes."""
    training = FOPGTraining(config_of(**DESCENDED), RunFolder(tmp_path))
    training.logger = Logger(folder=None, output_formats=[])
    training.start()
    learners, drivers = [], []
    for error in errors:
        training.next_round()
        training.progress.rows.append(row(64, error, 0.05))
        learners.append(training.learner)
        drivers.append(training.driver)
    assert len(set(map(id, learners))) == len(errors)
    training.next_round()
    assert training.learner is learners[best]
    assert training.driver is drivers[best]
    training.close()


def test_candidates_differ_and_meet_the_same_episodes(tmp_path: Path) -> None:
    training = FOPGTraining(config_of(**DESCENDED), RunFolder(tmp_path))
    training.start()

    def at_rest() -> Window:
        return training.driver.window(lambda seen: np.zeros((len(seen), 2)), 3)

    policy, window = training.policy(), at_rest()
    training.progress.rows.append(row(64, 0.1, 0.1))
    training._end_trial(last=False)
    assert not np.array_equal(policy.weights[0], training.policy().weights[0])
    assert np.array_equal(window.states, at_rest().states)
    training.close()
