"""Warm start: the policy with which a training begins, and the environments in which it begins."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from flexarm_agents.environments import settings_of
from flexarm_agents.policies.encoders import PastReadings, past_readings
from flexarm_agents.policies.load import load_policy
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.training.algorithms import PPOConfig
from flexarm_agents.training.config import RunConfig
from flexarm_agents.training.run_folder import RunFolder
from flexarm_env.envs.observation import observation_layout
from flexarm_env.validation import shown


def check_curriculum(config: RunConfig, field: str = "curriculum_options") -> None:
    """Check that training and score have the same observation and action; else raise a `ValueError`."""
    changed = getattr(config, field)
    whole = config.options | config.curriculum_options | changed
    if changed and not _alike(config.environment, config.options, whole):
        wrong = f"{field} = {shown(changed)}"
        raise ValueError(f"{wrong}: must leave observation and action of the environment as they are")


def initial_policy(config: PPOConfig, run: RunFolder) -> NetworkPolicy | None:
    """Load the policy whose network a training begins with, from the copy in its folder if there is one.

    Returns:
        The policy; None: the network begins untrained.

    Raises:
        FileNotFoundError: if there is no such policy.
        ValueError: if its network, or what it was trained on, does not fit the configuration.
    """
    if config.initial_policy is None:
        return None
    trained = load_policy(run.initial if run.initial.is_file() else config.initial_policy)
    name, policy = f"initial_policy = {shown(config.initial_policy)}", trained.policy
    if policy.log_std_weights is not None or not isinstance(policy.encoder, PastReadings | None):
        raise ValueError(f"{name}: must be a fully connected network, as PPO and teaching make it")
    if not _alike(config.environment, config.options, trained.options, trained.environment):
        raise ValueError(f"{name}: was trained on {trained.environment} with another observation or action")
    settings = settings_of(config.environment, config.options)
    encoders = policy.encoder, past_readings(config.lags, observation_layout(settings, settings.program).blocks)
    theirs, own = (((), ()) if one is None else (one.lags, one.remembered) for one in encoders)
    wanted = {
        "hidden": (tuple(len(bias) for bias in policy.biases[:-1]), config.hidden),
        "activation": (policy.activation, config.activation),
        "lags": (theirs[0], own[0]),
        "remembered": (theirs[1], own[1]),
    }
    for field, (has, must) in wanted.items():
        if has != must:
            raise ValueError(f"{name}: its {field} must be {must!r}, got {has!r}")
    return policy


def _alike(environment: str, options: Mapping[str, Any], others: Mapping[str, Any], another: str | None = None) -> bool:
    """Return whether observations and actions mean the same with other options, or in another environment."""
    one, other = settings_of(environment, options), settings_of(another or environment, others)
    layout, another_layout = (observation_layout(settings, settings.program) for settings in (one, other))
    names = ("frame", "previews", "action_mode", "action_limit")
    same = all(getattr(one, name) == getattr(other, name) for name in names)
    return same and layout.blocks == another_layout.blocks and np.array_equal(layout.scale, another_layout.scale)
