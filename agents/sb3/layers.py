"""Fully connected networks of torch: making them, and their layers as numbers."""

from collections.abc import Iterable, Sequence

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.torch_layers import create_mlp

from flexarm_agents.policies.network import ACTIVATIONS, NetworkPolicy

MODULES: dict[str, type[torch.nn.Module]] = {"elu": torch.nn.ELU, "tanh": torch.nn.Tanh, "relu": torch.nn.ReLU}
assert set(MODULES) == set(ACTIVATIONS)
Numbers = NDArray[np.float32]


def fully_connected(inputs: int, hidden: Sequence[int], outputs: int, activation: str) -> torch.nn.Sequential:
    """Make a network with hidden layers of these sizes; torch's generator draws its weights."""
    return torch.nn.Sequential(*create_mlp(inputs, outputs, [*hidden], MODULES[activation]))


def linear_layers(modules: Iterable[torch.nn.Module]) -> list[torch.nn.Linear]:
    """Return the layers among some modules."""
    return [layer for layer in modules if isinstance(layer, torch.nn.Linear)]


def weights_and_biases(modules: Iterable[torch.nn.Module]) -> tuple[list[Numbers], list[Numbers]]:
    """Return weights and biases of the layers among some modules."""
    layers = linear_layers(modules)
    return [numbers(layer.weight) for layer in layers], [numbers(layer.bias) for layer in layers]


def set_layers(modules: Iterable[torch.nn.Module], policy: NetworkPolicy) -> None:
    """Give the layers among some modules the weights and biases of a policy; other sizes are a `ValueError`."""
    layers = linear_layers(modules)
    sizes = [tuple(layer.weight.shape) for layer in layers]
    if sizes != [np.shape(weight) for weight in policy.weights]:
        raise ValueError(f"policy: must have layers {sizes}, got {[np.shape(weight) for weight in policy.weights]}")
    with torch.no_grad():
        for layer, weight, bias in zip(layers, policy.weights, policy.biases, strict=True):
            layer.weight.copy_(torch.from_numpy(np.array(weight)))
            layer.bias.copy_(torch.from_numpy(np.array(bias)))


def numbers(tensor: torch.Tensor) -> Numbers:
    """Return a copy of a tensor's numbers."""
    return tensor.detach().cpu().numpy().astype(np.float32, copy=True)
