"""Models of stable-baselines3 and sb3-contrib from configurations, with their environments."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv, VecMonitor

from flexarm_agents.environments import make_batch, make_one
from flexarm_agents.policies.encoders import Encoder, past_readings
from flexarm_agents.policies.observer import Observer
from flexarm_agents.sb3.encoded_vec_env import EncodedVecEnv
from flexarm_agents.sb3.layers import MODULES
from flexarm_agents.sb3.vec_env import FlexArmVecEnv
from flexarm_agents.training.config import TrainingConfig
from flexarm_agents.training.hyperparameters import ALGORITHMS, SETTINGS, own_settings
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.extras import needs_extra

ROUNDING = 1e-9  # of shares of a training
_OF_THE_ENVIRONMENT = ("n_timesteps", "n_envs", "env_kwargs.max_episode_steps")


@dataclass(frozen=True)
class ValueFirst:
    """A learning rate that has a level of its own while the value learns alone, before the schedule begins.

    Attributes:
        schedule: from the share of a training that is left to the rate.
        level: the rate before it.
        share: of the training, before it.
    """

    schedule: LinearSchedule
    level: float
    share: float

    def __call__(self, left: float) -> float:
        """Return the rate.

        Args:
            left: share of the training that is left.
        """
        rest = left / (1.0 - self.share)
        return self.level if rest >= 1.0 - ROUNDING else self.schedule(rest)


def hold_policy(model: BaseAlgorithm, held: bool) -> None:
    """Keep the policy of PPO as it is in the next updates, so that its value learns alone; or let it learn.

    Args:
        model: PPO with "MlpPolicy".
        held: keep it.
    """
    policy: Any = model.policy
    for part in (policy.mlp_extractor.policy_net, policy.action_net):
        part.requires_grad_(not held)
    policy.log_std.requires_grad_(not held)


def model_class(algorithm: str) -> Any:
    """Return the class of an algorithm.

    Args:
        algorithm: a name in `ALGORITHMS`.

    Raises:
        ModuleNotFoundError: without its package, naming the extra.
    """
    module, _, name = ALGORITHMS[algorithm].kind.rpartition(":")
    with needs_extra(f"algorithm = {algorithm!r}", "train"):
        return getattr(import_module(module), name)


def policy_class(algorithm: str) -> str | type:
    """Return the policy with which a model is made: its name in stable-baselines3, or a class of ours.

    Args:
        algorithm: a name in `ALGORITHMS`.
    """
    module, _, name = ALGORITHMS[algorithm].policy.rpartition(":")
    return getattr(import_module(module), name) if module else name


def new_model(config: TrainingConfig) -> BaseAlgorithm:
    """Make an untrained model with its environments.

    Args:
        config: the configuration.
    """
    made = model_class(config.algorithm)
    env = environments(config, config.lesson_options)
    return made(policy_class(config.algorithm), env, **arguments(config), seed=config.seed, device="cpu")


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
    encoder = encoder_of(config, env.observation_blocks)
    return plain if encoder is None else EncodedVecEnv(plain, encoder)


def encoder_of(config: TrainingConfig, blocks: dict[str, slice]) -> Encoder | None:
    """Return the encoder of the observations; None: there is none.

    Args:
        config: the configuration.
        blocks: where each block lies in an observation.
    """
    if config.observer != "none":
        return Observer(config.observer, config.environment, config.options)
    return past_readings(config.lags, blocks)


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
    found["learning_rate"] = rate = LinearSchedule(config.learning_rate, config.final_learning_rate, 1.0)
    if config.value_steps:
        found["learning_rate"] = ValueFirst(rate, config.value_learning_rate, config.value_steps / config.steps)
    return {**found, "policy_kwargs": policy}
