"""`Student`: the network that imitates the teacher, its optimiser, and its export as a policy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch.optim.lr_scheduler import CosineAnnealingLR
from torch.optim.swa_utils import AveragedModel

from flexarm_agents.policies.encoders import PastReadings
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.sb3.layers import fully_connected, numbers, weights_and_biases
from flexarm_agents.teaching.config import DAggerConfig
from flexarm_agents.teaching.rollouts import Rollout

LEAST_SPREAD = 1e-3  # of an input, by which it is divided
LOG_STD = -3.0  # of the exported policy: 5 % of the torque limits, where actions are drawn


class Student:
    """A network from observations and history to the torques, with inputs scaled by the first rollout's spread.

    Attributes:
        loss: mean of the last fit's weighted square errors, in squared actions.
    """

    def __init__(self, config: DAggerConfig, encoder: PastReadings | None, first: Rollout) -> None:
        """Make an untrained student; it draws its weights from torch's generator."""
        self.encoder, self._config, self.loss = encoder, config, float("nan")
        observations = first.observations
        past = () if encoder is None else encoder.remembered * len(encoder.lags)
        index = [*range(observations.shape[1]), *past]
        self._mean = torch.from_numpy(observations.mean(axis=0)[index])
        self._spread = torch.from_numpy(np.maximum(observations.std(axis=0), LEAST_SPREAD)[index])
        self._index = index
        self._mirror: tuple[torch.Tensor, ...] = ()  # signs of the inputs and of the actions in the mirror image
        self.network = fully_connected(len(index), config.hidden, first.answers.shape[1], config.activation)
        self.average = AveragedModel(self.network, avg_fn=self._mix)
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=config.learning_rate)
        self.schedule = CosineAnnealingLR(self.optimiser, config.rounds * config.updates)

    def mirror_with(self, observation: NDArray[np.float32], action: NDArray[np.float32]) -> None:
        """Learn from mirror images as well, given the signs of their observations and actions."""
        self._mirror = torch.from_numpy(observation[self._index]), torch.from_numpy(action)

    def fit(self, rollouts: Sequence[Rollout]) -> None:
        """Take the optimiser's steps of one round, on samples of all rollouts alike."""
        config = self._config
        *samples, _ = zip(*rollouts, strict=True)
        observations, ages, answers, weights = (torch.from_numpy(np.concatenate(part)) for part in samples)
        total = 0.0
        for _ in range(config.updates):
            chosen = torch.randint(len(observations), (config.batch,))
            inputs, wanted = self._inputs(observations, ages, chosen), answers[chosen]
            if self._mirror:  # half of the samples
                turned = torch.randint(2, (config.batch, 1))
                inputs, wanted = (x * signs**turned for x, signs in zip((inputs, wanted), self._mirror, strict=True))
            errors = torch.square(self.network((inputs - self._mean) / self._spread) - wanted).mean(dim=1)
            loss = torch.mean(weights[chosen] * errors)
            self.optimiser.zero_grad()
            loss.backward()  # type: ignore[no-untyped-call]
            self.optimiser.step()
            self.schedule.step()
            self.average.update_parameters(self.network)
            total += loss.item()
        self.loss = total / config.updates

    def policy(self) -> NetworkPolicy:
        """Return the average of the network's weights as a policy, with the inputs' scaling in its first layer."""
        weights, biases = weights_and_biases(self.average.module.modules())
        weights[0] = weights[0] / numbers(self._spread)
        biases[0] = biases[0] - weights[0] @ numbers(self._mean)
        log_std = np.full(len(biases[-1]), LOG_STD, dtype=np.float32)
        return NetworkPolicy(weights, biases, log_std, self._config.activation, encoder=self.encoder)

    def state(self) -> dict[str, Any]:
        """Return all that changes in a fit, tensors and plain values."""
        return {name: getattr(self, name).state_dict() for name in ("network", "average", "optimiser", "schedule")}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from what `state` returned."""
        for name, part in state.items():
            getattr(self, name).load_state_dict(part)

    def _inputs(self, observations: torch.Tensor, ages: torch.Tensor, chosen: torch.Tensor) -> torch.Tensor:
        """Return samples with their histories; before an episode's first observation it was always that one."""
        if self.encoder is None:
            return observations[chosen]
        parts, remembered = [observations[chosen]], list(self.encoder.remembered)
        for lag in self.encoder.lags:
            back = torch.clamp(ages[chosen], max=lag) * self._config.arms
            parts.append(observations[chosen - back][:, remembered])
        return torch.cat(parts, dim=1)

    def _mix(self, average: torch.Tensor, present: torch.Tensor, count: torch.Tensor | int) -> torch.Tensor:
        """Average over the last tenth of the updates at first, then forget at the configured rate."""
        share = max(1.0 - self._config.averaging, 10.0 / (int(count) + 10.0))
        return torch.lerp(average, present, share)
