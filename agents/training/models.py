"""Models of stable-baselines3 and sb3-contrib from configurations, with their environments."""

from collections.abc import Mapping
from functools import partial
from pkgutil import resolve_name
from typing import Any

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.utils import LinearSchedule
from stable_baselines3.common.vec_env import VecEnv, VecMonitor

from flexarm_agents.environments import make_batch, make_one, settings_of
from flexarm_agents.policies.encoders import past_readings
from flexarm_agents.policies.observer import Observer
from flexarm_agents.sb3.asymmetric import AsymmetricPolicy
from flexarm_agents.sb3.layers import MODULES
from flexarm_agents.sb3.vec_env import EncodedVecEnv, FlexArmVecEnv
from flexarm_agents.training.algorithms import PRIVILEGED_BLOCKS, PPOConfig, RecurrentPPOConfig, RewardConfig, SACConfig
from flexarm_agents.training.hyperparameters import names_in_zoo
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.extras import needs_extra

ROUNDING = 1e-9  # of shares of a training
_OF_THE_ENVIRONMENT = ("n_timesteps", "n_envs", "env_kwargs.max_episode_steps")


def value_first(schedule: LinearSchedule, level: float, share: float, left: float) -> float:
    """Return the learning rate where so much of a training is left, as a share of it.

    A constant `level` while the value learns alone, for a `share` of the training; then that of a schedule, by what is
    left of the rest.
    """
    rest = left / (1.0 - share)
    return level if rest >= 1.0 - ROUNDING else schedule(rest)


def hold_policy(model: BaseAlgorithm, held: bool) -> None:
    """Keep the policy of PPO as it is in the next updates, so that its value learns alone; or let it learn."""
    policy: Any = model.policy
    for part in (policy.mlp_extractor.policy_net, policy.action_net):
        part.requires_grad_(not held)
    policy.log_std.requires_grad_(not held)


def model_class(config: RewardConfig) -> Any:
    """Return the class of the algorithm."""
    with needs_extra(f"algorithm = {config.algorithm!r}", "train"):
        return resolve_name(config.kind)


def new_model(config: RewardConfig) -> BaseAlgorithm:
    """Make an untrained model with its environments."""
    env, found = environments(config, config.curriculum_options), arguments(config)
    policy: Any = config.policy
    if own := privileged_blocks(config):
        (blocks,) = env.get_attr("observation_blocks", 0)
        policy = AsymmetricPolicy
        found["policy_kwargs"]["privileged"] = blocks[own[-1]].stop - blocks[own[0]].start  # the last ones
    made: BaseAlgorithm = model_class(config)(policy, env, **found, seed=config.seed, device="cpu")
    return made


def end_curriculum(config: RewardConfig, model: BaseAlgorithm) -> None:
    """Replace the environments by some without `curriculum_options`; episodes begin in all of them."""
    before = model.get_env()
    assert before is not None
    before.close()
    env = environments(config, {})
    env.seed(config.seed)
    model.set_env(env)
    model._last_obs = env.reset()  # type: ignore[assignment]
    model._last_episode_starts = np.ones(config.envs, dtype=bool)


def environments(config: RewardConfig, curriculum_options: Mapping[str, Any]) -> VecMonitor:
    """Make the environments of a training."""
    options = {"max_episode_steps": config.episode_steps, **config.options, **curriculum_options, **_observed(config)}
    return VecMonitor(batch_for(config, make_batch(config.environment, config.envs, options)))


def privileged_blocks(config: RewardConfig) -> tuple[str, ...]:
    """Return the blocks that the value sees and the policy does not."""
    return PRIVILEGED_BLOCKS if isinstance(config, PPOConfig) and config.privileged_critic else ()


def _observed(config: RewardConfig) -> dict[str, Any]:
    """Return the option by which the value's own blocks are the last ones of the observation; nothing without any."""
    seen, own = settings_of(config.environment, config.options).observation, privileged_blocks(config)
    return {"observation": [*seen, *own]} if own else {}


def batch_for(config: RewardConfig, env: FlexArmVectorEnv) -> VecEnv:
    """Wrap a batch for stable-baselines3, with the configuration's encoder if it has one.

    Within a curriculum, the observation space is that of the environment of the score; observations may exceed it.
    """
    plain = FlexArmVecEnv(env)
    if config.curriculum_options:
        with make_one(config.environment, config.options | _observed(config)) as judged:
            plain.observation_space = judged.observation_space
    if not isinstance(config, PPOConfig):
        return plain
    if config.observer != "none":
        return EncodedVecEnv(plain, Observer(config.observer, config.environment, config.options))
    blocks = {name: place for name, place in env.observation_blocks.items() if name not in privileged_blocks(config)}
    encoder = past_readings(config.lags, blocks)
    return plain if encoder is None else EncodedVecEnv(plain, encoder)


def arguments(config: RewardConfig) -> dict[str, Any]:
    """Return the arguments of the model, by their names in stable-baselines3."""
    found: dict[str, Any] = {}
    policy: dict[str, Any] = {}
    for name, zoo in names_in_zoo(type(config)).items():
        where, _, inner = zoo.rpartition(".")
        if zoo not in _OF_THE_ENVIRONMENT:
            (policy if where else found)[inner] = getattr(config, name)
    policy |= {"net_arch": list(config.hidden), "activation_fn": MODULES[config.activation]}
    if isinstance(config, RecurrentPPOConfig):
        policy["shared_lstm"] = not config.critic_lstm
    if isinstance(config, SACConfig):
        found["ent_coef"] = f"auto_{config.temperature}"
    found["learning_rate"] = rate = LinearSchedule(config.learning_rate, config.final_learning_rate, 1.0)
    if isinstance(config, PPOConfig) and config.value_steps:
        share = config.value_steps / config.steps
        found["learning_rate"] = partial(value_first, rate, config.value_learning_rate, share)
    return {**found, "policy_kwargs": policy}
