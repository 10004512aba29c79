"""Models of stable-baselines3 and sb3-contrib from configurations, with their environments."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv, VecMonitor

from flexarm_agents.algorithms import ALGORITHMS, SETTINGS, own_settings
from flexarm_agents.config import TrainingConfig
from flexarm_agents.environments import make_batch, make_one
from flexarm_agents.fronted_vec_env import FrontedVecEnv
from flexarm_agents.fronts import Front, Stacked, readings_history
from flexarm_agents.layers import MODULES
from flexarm_agents.observer import Observer
from flexarm_agents.vec_env import FlexArmVecEnv
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.extras import needs_extra

_OF_THE_ENVIRONMENT = ("n_timesteps", "n_envs", "env_kwargs.max_episode_steps")


def model_class(algorithm: str) -> Any:
    """Return the class of an algorithm.

    Args:
        algorithm: a name in `ALGORITHMS`.

    Raises:
        ModuleNotFoundError: without its package, naming the extra.
    """
    one = ALGORITHMS[algorithm]
    with needs_extra(f"algorithm = {algorithm!r}", "train"):
        return getattr(import_module(one.module), one.text)


def new_model(config: TrainingConfig) -> BaseAlgorithm:
    """Make an untrained model with its environments.

    Args:
        config: the configuration.
    """
    made = model_class(config.algorithm)
    env = environments(config, config.lesson_options)
    return made(ALGORITHMS[config.algorithm].policy, env, **arguments(config), seed=config.seed, device="cpu")


def end_lessons(config: TrainingConfig, model: BaseAlgorithm) -> None:
    """Go on in environments without `lesson_options`; episodes begin in all of them.

    Args:
        config: of the training.
        model: made by `new_model`, between two rollouts.
    """
    lessons = model.get_env()
    assert lessons is not None
    lessons.close()
    env = environments(config, {})
    env.seed(config.seed)
    model.set_env(env)
    model._last_obs = env.reset()  # type: ignore[assignment]
    model._last_episode_starts = np.ones(config.envs, dtype=bool)


def environments(config: TrainingConfig, lesson_options: Mapping[str, Any]) -> VecMonitor:
    """Make the environments of a training.

    Args:
        config: its configuration.
        lesson_options: that hold in them.
    """
    options = {"max_episode_steps": config.episode_steps, **config.options, **lesson_options}
    return VecMonitor(batch_for(config, make_batch(config.environment, config.envs, options)))


def batch_for(config: TrainingConfig, env: FlexArmVectorEnv) -> VecEnv:
    """Put what the configuration has in front of the network over a batch.

    Lessons have the space of the observations that the agent is judged with: bounds beyond which a lesson may go.

    Args:
        config: the configuration.
        env: the batch.
    """
    plain = FlexArmVecEnv(env)
    if config.lesson_options:
        judged = make_one(config.environment, config.options)
        plain.observation_space = judged.observation_space
        judged.close()
    front = front_of(config, env.observation_blocks)
    return plain if front is None else FrontedVecEnv(plain, front)


def front_of(config: TrainingConfig, blocks: dict[str, slice]) -> Front | None:
    """Return what stands in front of the network; None: nothing.

    Args:
        config: the configuration.
        blocks: where each block lies in an observation.
    """
    if config.observer != "none":
        return Observer(config.observer, config.environment, config.options)
    if config.lags:
        return Stacked(readings_history(config.lags, blocks), max(part.stop for part in blocks.values()))
    return None


def arguments(config: TrainingConfig) -> dict[str, Any]:
    """Return the arguments of the model that the settings are, by their names in stable-baselines3."""
    found: dict[str, Any] = {}
    policy: dict[str, Any] = {}
    for name in own_settings(config.algorithm):
        key = SETTINGS[name].name
        where, _, inner = key.rpartition(".")
        if key not in _OF_THE_ENVIRONMENT:
            (policy if where else found)[inner] = getattr(config, name)
    policy |= {"net_arch": list(config.hidden), "activation_fn": MODULES[config.activation]}
    if config.critic_lstm is not None:
        policy["shared_lstm"] = not config.critic_lstm
    if config.temperature is not None:
        found["ent_coef"] = f"auto_{config.temperature}"
    found["learning_rate"] = LinearSchedule(config.learning_rate, config.final_learning_rate, 1.0)
    return {**found, "policy_kwargs": policy}
