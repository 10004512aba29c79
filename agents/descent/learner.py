"""`Learner`: the policy's network and the critic's, their optimisers, and their updates from a window.

Source: Xu, Makoviychuk, Narang, Ramos, Matusik, Garg & Macklin, *Accelerated policy learning with parallel
differentiable simulation*, ICLR 2022 (short-horizon actor-critic).
"""

from __future__ import annotations

import copy
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch.nn.utils import clip_grad_norm_
from torch.optim.lr_scheduler import LinearLR

from flexarm_agents.descent.adjoint import output_gradients
from flexarm_agents.descent.config import FOPGConfig
from flexarm_agents.descent.observations import Observations
from flexarm_agents.descent.window import Costs, Singles, Window, costs, largest_cost
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.sb3.layers import fully_connected, linear_layers, weights_and_biases

Floats = NDArray[np.float64]
FIRST_SCALE = 0.01  # of the policy's last layer: at first its outputs are nearly 0
MOMENTS = (0.7, 0.95)  # of Adam, as in the source: a window's gradient is hardly noisy, and soon stale
LOG_STD = -3.0  # of the exported policy: 5 % of the torque limits, where actions are drawn


class Figures(NamedTuple):
    """Figures of a window, for the log."""

    cost: float  # mean of its periods [m]
    error: float  # r.m.s. distance of the tip from the reference [m]
    norm: float  # of the gradient, before it is limited
    lost: float  # episodes that ended early


class Learner:
    """Networks in training; torch's generator draws their weights and the order of the critic's samples."""

    def __init__(self, config: FOPGConfig, observations: Observations, size: int) -> None:
        """Make untrained networks; the policy sees the first numbers of an observation, so many."""
        self._config, self._observations, self._size = config, observations, size
        settings = observations.settings
        self._lost_value = largest_cost(settings, config) / max(1.0 - config.gamma, 1.0 / config.episode_steps)
        self.policy_network = fully_connected(size, config.hidden, 2, config.activation)
        with torch.no_grad():
            last = linear_layers(self.policy_network)[-1]
            last.weight.mul_(FIRST_SCALE)
            last.bias.zero_()
        self.critic = fully_connected(len(observations.scale), config.hidden, 1, config.activation)
        self.target = copy.deepcopy(self.critic)
        networks = [self.policy_network, self.critic] if config.critic_epochs else [self.policy_network]
        self._optimisers = [
            torch.optim.Adam(one.parameters(), lr=config.learning_rate, betas=MOMENTS) for one in networks
        ]
        self._schedules = [LinearLR(one, 1.0, 0.0, config.rounds * config.windows) for one in self._optimisers]

    def outputs(self, observations: Singles) -> Singles:
        """Return the outputs of the policy's network, unlimited. Shape (n, 2)."""
        with torch.no_grad():
            return self.policy_network(torch.from_numpy(observations[:, : self._size])).numpy()

    def learn(self, window: Window) -> Figures:
        """Take one step of the policy's optimiser, and the critic's passes through the window."""
        found = costs(window, self._observations.settings, self._config)
        gradients = self.gradients(window, found)
        optimiser = self._optimisers[0]
        optimiser.zero_grad()
        seen = self._seen(window)
        loss = self.policy_network(seen) * torch.from_numpy(gradients.reshape(len(seen), 2).astype(np.float32))
        (loss.sum() / len(seen)).backward()
        norm = clip_grad_norm_(self.policy_network.parameters(), self._config.gradient_limit)
        optimiser.step()
        if self._config.critic_epochs:
            self._fit_critic(window, found)
        for schedule in self._schedules:
            schedule.step()
        lost = float(window.lost.sum())
        return Figures(float(found.total.mean()), float(np.sqrt((found.errors**2).mean())), float(norm), lost)

    def gradients(self, window: Window, found: Costs) -> Floats:
        """Differentiate the discounted costs and the value of what comes after by the outputs. Shape (T, n, 2)."""
        periods, count = window.ended.shape
        discounts = np.ones((periods + 1, count))
        for t in range(periods):
            discounts[t + 1] = np.where(window.ended[t], 1.0, self._config.gamma * discounts[t])
        seen = self._seen(window).requires_grad_()
        outputs = self.policy_network(seen)
        slopes = [torch.autograd.grad(outputs[:, n].sum(), seen, retain_graph=n == 0)[0].numpy() for n in (0, 1)]
        network = np.stack(slopes, axis=1).astype(np.float64).reshape(periods, count, 2, self._size)
        at_end = np.zeros((count, window.observations.shape[-1]))
        if self._config.critic_epochs:
            last = torch.from_numpy(window.observations[-1]).requires_grad_()
            slope = torch.autograd.grad(self.critic(last).sum(), last)[0].numpy()
            at_end = np.where(window.ended[-1][:, None], 0.0, discounts[-1][:, None] * slope)
        return output_gradients(self._observations, window, found, network, at_end, discounts[:-1])

    def policy(self) -> NetworkPolicy:
        """Return the network as a policy."""
        weights, biases = weights_and_biases(self.policy_network)
        log_std = np.full(len(biases[-1]), LOG_STD, dtype=np.float32)
        return NetworkPolicy(weights, biases, log_std, self._config.activation)

    def state(self) -> dict[str, Any]:
        """Return all that changes in the training."""
        networks = {name: getattr(self, name).state_dict() for name in ("policy_network", "critic", "target")}
        return {**networks, "steppers": [one.state_dict() for one in self._steppers()]}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned."""
        for name in ("policy_network", "critic", "target"):
            getattr(self, name).load_state_dict(state[name])
        for one, kept in zip(self._steppers(), state["steppers"], strict=True):
            one.load_state_dict(kept)

    def _steppers(self) -> list[Any]:
        return [*self._optimisers, *self._schedules]

    def _seen(self, window: Window) -> torch.Tensor:
        """Return what the policy sees in all periods. Shape (T * n, numbers)."""
        seen = window.observations[:-1, :, : self._size]
        return torch.from_numpy(seen.reshape(-1, self._size))

    def _fit_critic(self, window: Window, found: Costs) -> None:
        config, optimiser = self._config, self._optimisers[1]
        inputs = torch.from_numpy(window.observations[:-1].reshape(-1, window.observations.shape[-1]))
        targets = torch.from_numpy(self._targets(window, found).reshape(-1, 1).astype(np.float32))
        for _ in range(config.critic_epochs):
            for chosen in torch.split(torch.randperm(len(inputs)), config.critic_batch):
                optimiser.zero_grad()
                loss = torch.square(self.critic(inputs[chosen]) - targets[chosen]).mean()
                loss.backward()  # type: ignore[no-untyped-call]
                clip_grad_norm_(self.critic.parameters(), config.gradient_limit)
                optimiser.step()
        with torch.no_grad():
            for average, present in zip(self.target.parameters(), self.critic.parameters(), strict=True):
                average.lerp_(present, 1.0 - config.critic_averaging)

    def _targets(self, window: Window, found: Costs) -> Floats:
        """Return the critic's targets, the window's costs and values as TD(lambda) returns. Shape (T, n)."""
        config = self._config
        flat = torch.from_numpy(window.last.reshape(-1, window.last.shape[-1]))
        with torch.no_grad():
            values = self.target(flat).numpy().reshape(window.ended.shape).astype(np.float64)
        values[window.lost] = self._lost_value
        targets, later = np.empty_like(values), values[-1]
        for t in range(len(values) - 1, -1, -1):
            mixed = (1.0 - config.critic_lambda) * values[t] + config.critic_lambda * later
            later = found.total[t] + config.gamma * np.where(window.ended[t], values[t], mixed)
            targets[t] = later
        return targets
