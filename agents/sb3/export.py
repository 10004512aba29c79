"""From a stable-baselines3 model to a policy that numpy alone runs."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import unwrap_vec_wrapper

from flexarm_agents.policies.encoded import EncodedPolicy
from flexarm_agents.policies.encoders import Encoder, Stacked
from flexarm_agents.policies.history import History
from flexarm_agents.policies.lstm import Lstm
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.policies.observer import Observer
from flexarm_agents.policies.squashed import SquashedPolicy
from flexarm_agents.sb3.encoded_vec_env import EncodedVecEnv
from flexarm_agents.sb3.layers import MODULES, numbers, set_layers, weights_and_biases


def network_policy(model: BaseAlgorithm, notes: dict[str, Any] | None = None) -> NetworkPolicy:
    """Extract the policy of a model, as numbers.

    Args:
        model: PPO, SAC or TQC with "MlpPolicy", or RecurrentPPO with "MlpLstmPolicy", on vectors; its environment may
            be a `EncodedVecEnv`.
        notes: to keep with it.
    """
    policy: Any = model.policy
    kept = dict(notes or {})
    actor = getattr(policy, "actor", None)
    if actor is not None:
        weights, biases = weights_and_biases([*actor.latent_pi, actor.mu])
        return SquashedPolicy(
            weights,
            biases,
            numbers(actor.log_std.bias),
            _activation(actor.activation_fn),
            kept,
            spread=numbers(actor.log_std.weight),
        )
    weights, biases = weights_and_biases([*policy.mlp_extractor.policy_net, policy.action_net])
    common: dict[str, Any] = {
        "weights": weights,
        "biases": biases,
        "log_std": numbers(policy.log_std),
        "activation": _activation(policy.activation_fn),
        "notes": kept,
    }
    memory = getattr(policy, "lstm_actor", None)
    encoder = _encoder(model) if memory is None else _lstm(memory)
    if isinstance(encoder, Lstm | Observer):
        return EncodedPolicy(**common, encoder=encoder)
    return NetworkPolicy(**common, history=encoder.history if isinstance(encoder, Stacked) else History())


def set_network(model: BaseAlgorithm, policy: NetworkPolicy) -> None:
    """Give a model the network of a policy; its value and its actions' deviation stay as they are.

    Args:
        model: PPO with "MlpPolicy", on vectors.
        policy: of the same layers.

    Raises:
        ValueError: if the layers have other sizes.
    """
    target: Any = model.policy
    set_layers([*target.mlp_extractor.policy_net, target.action_net], policy)


def _encoder(model: BaseAlgorithm) -> Encoder | None:
    """Return what stands in front of a model's network."""
    env = model.get_env()
    encoded = None if env is None else unwrap_vec_wrapper(env, EncodedVecEnv)
    return None if encoded is None else encoded.encoder


def _lstm(layer: Any) -> Lstm:
    """Take the only layer of torch's LSTM."""
    bias = np.add(numbers(layer.bias_ih_l0), numbers(layer.bias_hh_l0))
    return Lstm(numbers(layer.weight_ih_l0), numbers(layer.weight_hh_l0), bias)


def _activation(wanted: type[torch.nn.Module]) -> str:
    (name,) = [name for name, module in MODULES.items() if wanted is module]
    return name
