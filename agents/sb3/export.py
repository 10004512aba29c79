"""From a stable-baselines3 model to a policy that numpy alone runs."""

from typing import Any

import numpy as np
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import unwrap_vec_wrapper

from flexarm_agents.policies.lstm import Lstm
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.sb3.layers import MODULES, numbers, set_layers, weights_and_biases
from flexarm_agents.sb3.vec_env import EncodedVecEnv


def network_policy(model: BaseAlgorithm, notes: dict[str, Any] | None = None) -> NetworkPolicy:
    """Extract the policy of a model, as numbers.

    Args:
        model: PPO, SAC or TQC with "MlpPolicy", or RecurrentPPO with "MlpLstmPolicy", on vectors; its environment may
            be an `EncodedVecEnv`.
        notes: to keep with it.
    """
    policy: Any = model.policy
    actor = getattr(policy, "actor", None)  # of SAC and TQC
    if actor is None:
        modules, kind = [*policy.mlp_extractor.policy_net, policy.action_net], policy.activation_fn
        log_std, log_std_weights = numbers(policy.log_std), None
    else:
        modules, kind = [*actor.latent_pi, actor.mu], actor.activation_fn
        log_std, log_std_weights = numbers(actor.log_std.bias), numbers(actor.log_std.weight)
    weights, biases = weights_and_biases(modules)
    (activation,) = [name for name, module in MODULES.items() if kind is module]
    return NetworkPolicy(weights, biases, log_std, activation, dict(notes or {}), _encoder(model), log_std_weights)


def set_network(model: BaseAlgorithm, policy: NetworkPolicy) -> None:
    """Give PPO's model the network of a policy; its value and its actions' standard deviation stay as they are.

    Raises:
        ValueError: if the layers have other sizes.
    """
    target: Any = model.policy
    set_layers([*target.mlp_extractor.policy_net, target.action_net], policy)


def _encoder(model: BaseAlgorithm) -> Any:
    """Return the encoder of a model: an LSTM, the one over its environments, or None."""
    layer = getattr(model.policy, "lstm_actor", None)
    if layer is not None:
        bias = np.add(numbers(layer.bias_ih_l0), numbers(layer.bias_hh_l0))
        return Lstm(numbers(layer.weight_ih_l0), numbers(layer.weight_hh_l0), bias)
    env = model.get_env()
    encoded = None if env is None else unwrap_vec_wrapper(env, EncodedVecEnv)
    return None if encoded is None else encoded.encoder
