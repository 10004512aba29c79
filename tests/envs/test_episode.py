"""The description of an episode, and registered limits shorter than a lap."""

import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from flexarm_agents import FlexArmVecEnv
from flexarm_env import run_policy
from flexarm_env.envs.info import Episode
from flexarm_env.envs.reset_options import DRAWN
from flexarm_env.envs.single import FlexArmEnv
from tests.support.envs import SQUARE, make, vector

RANDOM_EPISODES: dict[str, Any] = {
    "randomisation": {"payload_mass": (0.0, 0.5), "delay": (0.01, 0.05)},
    "reference": ("square", "circle", "line"),
    "start": "mix",
}


def test_the_episode_is_described_by_a_copy() -> None:
    batch = vector(SQUARE, 4, autoreset_mode="SameStep", max_episode_steps=4, **RANDOM_EPISODES)
    batch.reset(seed=5)
    described = batch.episode
    assert isinstance(described, Episode)
    assert set(described.parameters) == set(DRAWN)
    assert all(np.shape(each) == (4,) for each in (*described.parameters.values(), *described[1:]))
    before = pickle.dumps(described)
    for _ in range(5):
        batch.step(np.zeros((4, 2), np.float32))
    assert pickle.dumps(described) == before
    assert (batch.episode.parameters["payload_mass"] != described.parameters["payload_mass"]).all()


def test_stable_baselines3_reads_each_environments_own() -> None:
    batch = FlexArmVecEnv.make(SQUARE, 3, **RANDOM_EPISODES)
    batch.seed(1)
    batch.reset()
    found = batch.get_attr("episode", [0, 2])
    assert found == [batch.env.episode.one(0), batch.env.episode.one(2)]
    assert found[0] != found[1]


@pytest.mark.parametrize("options", [{"control_period": 0.001}, {"lap_time": 20.0}])
def test_a_registered_limit_below_a_lap_is_told(options: dict[str, Any]) -> None:
    """Where the user gave none; in the batch when it is made, else when the limit has struck."""
    lap = FlexArmEnv(**options).lap_steps
    message = rf"limit of 1600 control periods is shorter than a lap of {lap} .* max_episode_steps={lap}"
    with pytest.warns(UserWarning, match=message):
        gym.make_vec(SQUARE, num_envs=2, **options)
    gym.make_vec(SQUARE, num_envs=2, max_episode_steps=400, **options)
    free = {"error_limit": None, "deflection_limit": None, "start": "corner"} | options
    for limit, warns in ((None, True), (400, False)):
        env = make(**free) if limit is None else make(max_episode_steps=limit, **free)
        env.reset(seed=0)
        while not env.step(np.zeros(2, np.float32))[3]:
            pass
        if warns:
            with pytest.warns(UserWarning, match=message):
                env.reset()
        env.reset()  # once
    with pytest.warns(UserWarning, match=message):
        run_policy(make(error_limit=1e-6, **options), lambda observation: np.zeros(2))
    run_policy(make(error_limit=1e-6, max_episode_steps=lap, **options), lambda observation: np.zeros(2))
