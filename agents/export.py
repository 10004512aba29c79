"""From a stable-baselines3 model to a `NetworkPolicy`."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from stable_baselines3 import PPO

from flexarm_agents.network import ACTIVATIONS, NetworkPolicy

MODULES: dict[str, type[torch.nn.Module]] = {"elu": torch.nn.ELU, "tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}
assert set(MODULES) == set(ACTIVATIONS)


def network_policy(model: PPO, notes: dict[str, Any] | None = None) -> NetworkPolicy:
    """Extract the policy of a model, as numbers.

    Args:
        model: with stable-baselines3's "MlpPolicy" on vectors.
        notes: to keep with it.
    """
    policy = model.policy
    hidden = policy.mlp_extractor.policy_net
    layers = [layer for layer in (*hidden, policy.action_net) if isinstance(layer, torch.nn.Linear)]
    (activation,) = [name for name, module in MODULES.items() if policy.activation_fn is module]

    def numbers(parameter: torch.Tensor) -> np.ndarray[Any, np.dtype[np.float32]]:
        return parameter.detach().cpu().numpy().astype(np.float32, copy=True)

    return NetworkPolicy(
        [numbers(layer.weight) for layer in layers],
        [numbers(layer.bias) for layer in layers],
        numbers(policy.log_std),
        activation,
        dict(notes or {}),
    )
