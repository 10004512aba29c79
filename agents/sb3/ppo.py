"""`LeanPPO`: stable-baselines3's PPO, whose gradients are written out: the same numbers in less time.

Half of the library's time for a minibatch of small networks goes into what surrounds the matrix products: the graph of
some forty small operations, an optimiser that walks through a dozen parameters, figures for the log. Here derivatives
are written out, and Adam has one vector of all parameters. Each operation is the one that the library's graph does, in
its order, so that results are equal to the last bit where both have the same matrix products.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.distributions import DiagGaussianDistribution
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import FlattenExtractor
from stable_baselines3.common.type_aliases import RolloutBufferSamples
from stable_baselines3.common.utils import explained_variance
from torch.nn import functional
from torch.optim.adam import adam

from flexarm_agents.sb3.layers import linear_layers

Tensor = torch.Tensor
_ALIGNED = 16  # numbers; matrix products round otherwise where a matrix begins elsewhere than at 64 bytes
_MOMENTS = ("exp_avg", "exp_avg_sq")  # of Adam's state


class Activation(NamedTuple):
    """An activation and its derivative.

    Attributes:
        forward: of the sums of a layer.
        backward: derivative by the sums, from that by the outputs, sums and outputs.
    """

    forward: Callable[[Tensor], Tensor]
    backward: Callable[[Tensor, Tensor, Tensor], Tensor]


_aten = torch.ops.aten
ACTIVATIONS: dict[type[torch.nn.Module], Activation] = {
    torch.nn.ELU: Activation(
        functional.elu, lambda slope, sums, outputs: _aten.elu_backward(slope, 1.0, 1.0, 1.0, False, sums)
    ),
    torch.nn.Tanh: Activation(torch.tanh, lambda slope, sums, outputs: _aten.tanh_backward(slope, outputs)),
    torch.nn.ReLU: Activation(torch.relu, lambda slope, sums, outputs: _aten.threshold_backward(slope, outputs, 0)),
}


class Losses(NamedTuple):
    """What is logged of a minibatch, before its step.

    Attributes:
        policy: clipped surrogate loss.
        value: mean squared error of the values.
        ratio: of the likelihoods of the actions, new by old. Shape (n,).
        log_ratio: its logarithm. Shape (n,).
        log_std: sum of the logarithms of the standard deviations.
    """

    policy: Tensor
    value: Tensor
    ratio: Tensor
    log_ratio: Tensor
    log_std: Tensor


class Likelihood:
    """The logarithm of a diagonal Gaussian's density, in the operations of `torch.distributions.Normal`.

    Attributes:
        log: of each action. Shape (n,).
    """

    def __init__(self, actions: Tensor, mean: Tensor, log_std: Tensor) -> None:
        """Compute it.

        Args:
            actions: shape (n, m).
            mean: shape (n, m).
            log_std: logarithms of the standard deviations. Shape (m,).
        """
        self._spread = log_std.exp()
        self._std = torch.ones_like(mean) * self._spread
        self._off = actions - mean
        self._twice = 2 * self._std**2
        self._quotient = -(self._off**2) / self._twice
        self.log = (self._quotient - self._std.log() - math.log(math.sqrt(2 * math.pi))).sum(dim=1)

    def backward(self, slope: Tensor) -> tuple[Tensor, Tensor]:
        """Return derivatives by mean, shape (n, m), and logarithms of the standard deviations, shape (m,).

        Args:
            slope: derivative by `log`. Shape (n,).
        """
        each = slope.unsqueeze(1)
        by_off = (each / self._twice).neg() * (2 * self._off)
        by_std = (-each * (self._quotient / self._twice)) * 2 * (2 * self._std) - each / self._std
        return by_off.neg(), by_std.sum(dim=0) * self._spread


class FlatParameters:
    """The parameters of a policy in one vector, their derivatives in another, and Adam over both."""

    def __init__(self, policy: ActorCriticPolicy) -> None:
        """Take parameters and the state of the optimiser; they are the policy's again after `give_back`.

        Args:
            policy: with an Adam of one group of parameters, which has stepped all of them together.
        """
        self._parameters: list[Tensor] = list(policy.parameters())
        self._optimizer = policy.optimizer
        self._vector = _joined(self._parameters)
        self._gradient = torch.zeros_like(self._vector)
        self._values, self._slopes = (
            dict(zip(self._parameters, _parts(vector, self._parameters), strict=True))
            for vector in (self._vector, self._gradient)
        )
        group, states = policy.optimizer.param_groups[0], [policy.optimizer.state[one] for one in self._parameters]
        known = all(states)
        self._settings = {
            "lr": group["lr"],
            "beta1": group["betas"][0],
            "beta2": group["betas"][1],
            "eps": group["eps"],
        }
        self._moments = {
            name: _joined([state[name] for state in states]) if known else torch.zeros_like(self._vector)
            for name in _MOMENTS
        }
        self._steps = states[0]["step"].clone() if known else torch.tensor(0.0)

    def value(self, parameter: Tensor) -> Tensor:
        """Return a parameter's part of the vector."""
        return self._values[parameter]

    def slope(self, parameter: Tensor) -> Tensor:
        """Return a parameter's part of the derivatives."""
        return self._slopes[parameter]

    def step(self, largest: float) -> None:
        """Step against the derivatives, whose norm is at most some number."""
        norms = torch.stack([torch.linalg.vector_norm(one) for one in self._slopes.values()])
        self._gradient *= (largest / (torch.linalg.vector_norm(norms) + 1e-6)).clamp(max=1.0)
        adam(
            [self._vector],
            [self._gradient],
            [self._moments["exp_avg"]],
            [self._moments["exp_avg_sq"]],
            [],
            [self._steps],
            foreach=False,
            amsgrad=False,
            weight_decay=0.0,
            maximize=False,
            **self._settings,
        )

    def give_back(self) -> None:
        """Set the policy's parameters and the state of its optimiser."""
        moments = {name: _parts(self._moments[name], self._parameters) for name in _MOMENTS}
        for n, one in enumerate(self._parameters):
            one.copy_(self._values[one])
            own = {name: parts[n].clone() for name, parts in moments.items()}
            self._optimizer.state[one] = {"step": self._steps.clone(), **own}


class Head:
    """Layers of a network that keep what the way back needs."""

    def __init__(self, hidden: torch.nn.Sequential, last: torch.nn.Module, flat: FlatParameters) -> None:
        """Take layers.

        Args:
            hidden: linear layers, each with an activation after it.
            last: a linear layer.
            flat: has their parameters.
        """
        layers = linear_layers([*hidden, last])
        self._layers = [(flat.value(one.weight), flat.value(one.bias)) for one in layers]
        self._slopes = [(flat.slope(one.weight), flat.slope(one.bias)) for one in layers]
        self._activations = [ACTIVATIONS[type(one)] for one in list(hidden)[1::2]]
        self._inputs: list[Tensor] = []
        self._sums: list[Tensor] = []

    def __call__(self, inputs: Tensor) -> Tensor:
        """Run the layers. Shapes (n, inputs) and (n, outputs)."""
        self._inputs, self._sums = [inputs], []
        for (weight, bias), activation in zip(self._layers, self._activations, strict=False):
            self._sums.append(torch.addmm(bias, self._inputs[-1], weight.t()))
            self._inputs.append(activation.forward(self._sums[-1]))
        weight, bias = self._layers[-1]
        return torch.addmm(bias, self._inputs[-1], weight.t())

    def backward(self, slope: Tensor) -> None:
        """Set the derivatives by the parameters.

        Args:
            slope: derivative by the outputs. Shape (n, outputs).
        """
        for n in reversed(range(len(self._layers))):
            by_weight, by_bias = self._slopes[n]
            torch.mm(slope.t(), self._inputs[n], out=by_weight)
            torch.sum(slope, 0, out=by_bias)
            if n:
                by_output = torch.mm(slope, self._layers[n][0])
                slope = self._activations[n - 1].backward(by_output, self._sums[n - 1], self._inputs[n])


def _joined(tensors: Sequence[Tensor]) -> Tensor:
    """Return one vector of tensors, each of which begins where matrix products want it; gaps are zero."""
    return torch.cat([functional.pad(one.detach().flatten(), (0, -one.numel() % _ALIGNED)) for one in tensors])


def _parts(vector: Tensor, shapes: Sequence[Tensor]) -> list[Tensor]:
    """Return the parts of a vector that `_joined` made, as views.

    Args:
        vector: of tensors.
        shapes: tensors of the same shapes.
    """
    sizes = [one.numel() + -one.numel() % _ALIGNED for one in shapes]
    return [part[: one.numel()].view_as(one) for part, one in zip(torch.split(vector, sizes), shapes, strict=True)]


def _alternate(hidden: torch.nn.Module) -> bool:
    """Return whether layers are linear ones, each with a known activation after it."""
    layers = list(hidden.children())
    return (
        all(type(one) is torch.nn.Linear for one in layers[::2])
        and all(type(one) in ACTIVATIONS for one in layers[1::2])
        and len(layers) % 2 == 0
    )


def _in_step(policy: ActorCriticPolicy) -> bool:
    """Return whether the optimiser has taken as many steps with each parameter; not so where some were held."""
    states = [policy.optimizer.state.get(one, {}) for one in policy.parameters()]
    return len({float(state.get("step", 0.0)) for state in states}) == 1


class LeanPPO(PPO):
    """PPO as stable-baselines3 has it; `train` does for its "MlpPolicy" what the library does, in less time.

    Where something is not as that policy has it (another distribution, extractor or optimiser, parameters that are
    held or were held, a clipped value, a largest divergence), the library's own `train` runs.
    """

    def train(self) -> None:
        """Update the policy by the rollout buffer."""
        if not self._is_plain():
            super().train()
            return
        policy = self.policy
        policy.set_training_mode(True)
        self._update_learning_rate(policy.optimizer)
        clip = self.clip_range(self._current_progress_remaining)  # type: ignore[operator]
        with torch.no_grad():
            flat = FlatParameters(policy)
            actor = Head(policy.mlp_extractor.policy_net, policy.action_net, flat)
            critic = Head(policy.mlp_extractor.value_net, policy.value_net, flat)
            logs = []
            for _ in range(self.n_epochs):
                for batch in self.rollout_buffer.get(self.batch_size):
                    logs.append(self._minibatch(batch, flat, actor, critic, clip))
                self._n_updates += 1
            flat.give_back()
        self._log(logs, clip)

    def _is_plain(self) -> bool:
        policy = self.policy
        return (
            type(policy) is ActorCriticPolicy
            and type(policy.features_extractor) is FlattenExtractor
            and type(policy.action_dist) is DiagGaussianDistribution
            and type(policy.optimizer) is torch.optim.Adam
            and not any(policy.optimizer.defaults[name] for name in ("weight_decay", "amsgrad", "maximize"))
            and _alternate(policy.mlp_extractor.policy_net)
            and _alternate(policy.mlp_extractor.value_net)
            and all(one.requires_grad for one in policy.parameters())
            and _in_step(policy)
            and len(self.observation_space.shape or ()) == 1
            and self.clip_range_vf is None
            and self.target_kl is None
            and self.normalize_advantage
            and 1 < self.batch_size <= self.rollout_buffer.buffer_size * self.n_envs
        )

    def _minibatch(
        self, batch: RolloutBufferSamples, flat: FlatParameters, actor: Head, critic: Head, clip: float
    ) -> Losses:
        """Do one step of the optimiser, and return the losses before it."""
        log_std = flat.value(self.policy.log_std)
        advantages = (batch.advantages - batch.advantages.mean()) / (batch.advantages.std() + 1e-8)
        mean, values = actor(batch.observations), critic(batch.observations)
        likelihood = Likelihood(batch.actions, mean, log_std)
        log_ratio = likelihood.log - batch.old_log_prob
        ratio = log_ratio.exp()
        plain, clipped = advantages * ratio, advantages * ratio.clamp(1.0 - clip, 1.0 + clip)
        # Where the clipped one is less, its derivative is zero; else both terms are the same, or the plain one is less.
        slope = (-1.0 / len(ratio)) * advantages * (plain <= clipped) * ratio
        by_mean, by_log_std = likelihood.backward(slope)
        actor.backward(by_mean)
        flat.slope(self.policy.log_std).copy_(by_log_std - self.ent_coef)
        returns = batch.returns.unsqueeze(1)
        critic.backward(_aten.mse_loss_backward(torch.tensor(self.vf_coef), values, returns, 1))
        policy_loss, value_loss = -torch.min(plain, clipped).mean(), functional.mse_loss(values, returns)
        losses = Losses(policy_loss, value_loss, ratio, log_ratio, log_std.sum())
        flat.step(self.max_grad_norm)
        return losses

    def _log(self, logs: Sequence[Losses], clip: float) -> None:
        """Record what the library records."""
        last = logs[-(len(logs) // self.n_epochs) :]
        ratio = torch.cat([one.ratio for one in logs])
        ended = torch.cat([one.ratio - 1.0 - one.log_ratio for one in last])
        entropy = torch.stack([one.log_std for one in logs]) + 0.5 * len(self.policy.log_std) * math.log(
            2 * math.pi * math.e
        )
        policy_loss, value_loss = torch.stack([one.policy for one in logs]), torch.stack([one.value for one in logs])
        loss = policy_loss[-1] - self.ent_coef * entropy[-1] + self.vf_coef * value_loss[-1]
        buffer = self.rollout_buffer
        figures = {
            "entropy_loss": -float(entropy.mean()),
            "policy_gradient_loss": float(policy_loss.mean()),
            "value_loss": float(value_loss.mean()),
            "approx_kl": float(ended.mean()),
            "clip_fraction": float(((ratio - 1.0).abs() > clip).float().mean()),
            "loss": float(loss),
            "explained_variance": explained_variance(buffer.values.flatten(), buffer.returns.flatten()),
            "std": float(self.policy.log_std.detach().exp().mean()),
            "clip_range": clip,
        }
        for name, figure in figures.items():
            self.logger.record(f"train/{name}", figure)
        self.logger.record("train/n_updates", self._n_updates, exclude="tensorboard")
