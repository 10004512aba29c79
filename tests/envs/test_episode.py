"""The description of an episode; resets that are refused, and registered limits shorter than a lap."""

from __future__ import annotations

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
from tests.support.envs import SQUARE, bare, make, vector
from tests.support.refusals import refuses

RANDOM_EPISODES: dict[str, Any] = {
    "randomisation": {"payload_mass": (0.0, 0.5), "delay": (0.01, 0.05)},
    "reference": ("square", "circle", "line"),
    "start": "mix",
}


# --- the episode --------------------------------------------------------------------------------------------


def test_the_episode_is_described_single_and_batch() -> None:
    batch = vector(SQUARE, 4, autoreset_mode="SameStep", max_episode_steps=4, **RANDOM_EPISODES)
    singles = [make(max_episode_steps=4, **RANDOM_EPISODES) for _ in range(4)]
    batch.reset(seed=5)
    for i, env in enumerate(singles):
        env.reset(seed=5 + i)
    for k in range(1, 10):
        described = batch.episode
        assert isinstance(described, Episode)
        assert set(described.parameters) == set(DRAWN)
        assert all(np.shape(each) == (4,) for each in (*described.parameters.values(), *described[1:]))
        for i, env in enumerate(singles):
            assert described.one(i) == env.unwrapped.episode  # type: ignore[attr-defined]
        before = pickle.dumps(described)
        batch.step(np.zeros((4, 2), np.float32))
        for env in singles:
            if env.step(np.zeros(2, np.float32))[3]:
                env.reset()
        assert pickle.dumps(described) == before, k  # it is a copy


def test_before_the_first_reset_there_is_no_episode() -> None:
    for env in (FlexArmEnv(), gym.make_vec(SQUARE, num_envs=2)):
        assert not hasattr(env, "episode")
        with refuses(AttributeError, "episode", "reset()"):
            _ = env.episode  # type: ignore[union-attr]


def test_stable_baselines3_reads_each_environments_own() -> None:
    batch = FlexArmVecEnv.make(SQUARE, 3, **RANDOM_EPISODES)
    batch.seed(1)
    batch.reset()
    found = batch.get_attr("episode", [0, 2])
    assert found == [batch.env.episode.one(0), batch.env.episode.one(2)]
    assert found[0] != found[1]


class NoTorque:
    """No torque."""

    def predict(self, observation: Any, state: Any, start: Any, deterministic: bool) -> Any:
        return np.zeros(2, np.float32), None


# --- reset and time limit -----------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [{"options": {"bad": 1}}, {"options": {"time": -1.0}}, {"seed": -1}])
def test_a_refused_reset_changes_nothing(bad: dict[str, Any]) -> None:
    env, batch = bare(seed=1, start="moving"), vector(SQUARE, 2, start="moving")
    batch.reset(seed=1)
    twins = bare(seed=1, start="moving"), vector(SQUARE, 2, start="moving")
    twins[1].reset(seed=1)
    for each, twin in zip((env, batch), twins, strict=True):
        with pytest.raises((TypeError, ValueError, gym.error.Error)):
            each.reset(**({"seed": 99} | bad))
        np.testing.assert_array_equal(each.reset()[0], twin.reset()[0])


def test_one_bad_seed_of_several_changes_nothing() -> None:
    batch, twin = vector(SQUARE, 2, start="moving"), vector(SQUARE, 2, start="moving")
    batch.reset(seed=1)
    twin.reset(seed=1)
    with pytest.raises(ValueError, match=r"seed\[1\] = -1"):
        batch.reset(seed=[7, -1])
    np.testing.assert_array_equal(batch.reset()[0], twin.reset()[0])


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
        run_policy(make(error_limit=1e-6, **options), NoTorque())
    run_policy(make(error_limit=1e-6, max_episode_steps=lap, **options), NoTorque())
