"""PPO with a learned forecast of what a late sensor does not show yet.

A second network learns, from past readings, the part of the present state that no sensor without delay reads: modal
coordinates and rates. It is trained by their true values on each rollout, and the policy sees its forecast beside the
readings. Source: Wu et al., *Directly forecasting belief for reinforcement learning with delays*, ICML 2025, with a
fully connected network in the place of the transformer.
"""

from typing import Any, Self

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor

from flexarm_agents import PPOConfig
from flexarm_agents.environments import make_batch, settings_of
from flexarm_agents.policies.encoders import Array, Memory, PastReadings, past_readings
from flexarm_agents.sb3.asymmetric import FirstNumbers
from flexarm_agents.sb3.export import network_policy
from flexarm_agents.sb3.layers import fully_connected, linear_layers
from flexarm_agents.sb3.vec_env import EncodedVecEnv, FlexArmVecEnv
from flexarm_agents.training.models import arguments
from flexarm_agents.training.train import one_thread
from scripts.learning.judge import Judge, Outcome

UNSEEN = ("modal_coordinates", "modal_rates")  # blocks of an observation that are forecast
HIDDEN, BATCH, PASSES, LEARNING_RATE = (128, 128), 512, 4, 1e-3


class Forecaster(PastReadings):
    """Past readings, followed by a network's forecast of the present; an `Encoder` that learns."""

    network: torch.nn.Sequential
    optimiser: torch.optim.Adam

    @classmethod
    def of(cls, past: PastReadings, outputs: int) -> Self:
        """Begin with an untrained network."""
        made = cls(past.size, past.lags, past.remembered)
        network = fully_connected(past.inputs, HIDDEN, outputs, "elu")
        object.__setattr__(made, "network", network)
        object.__setattr__(made, "optimiser", torch.optim.Adam(network.parameters(), LEARNING_RATE))
        return made

    @property
    def readings(self) -> int:
        """How many inputs are readings."""
        return super().inputs

    @property
    def inputs(self) -> int:
        """See `Encoder`."""
        return self.readings + len(linear_layers(self.network)[-1].bias)

    def advance(self, observations: Array, memory: Memory) -> tuple[Array, Memory]:
        """See `Encoder`."""
        readings, after = super().advance(observations, memory)
        with torch.no_grad():
            forecast = self.network(torch.from_numpy(readings)).numpy()
        return np.concatenate([readings, forecast], axis=1), after

    def learn(self, inputs: Array, present: Array) -> None:
        """Lower the squared error of the forecasts of n instants.

        Args:
            inputs: their encoded observations. Shape (n, inputs).
            present: the truth. Shape (n, outputs).
        """
        whole = torch.from_numpy(inputs[:, : self.readings]), torch.from_numpy(present)
        for _ in range(PASSES):
            for chosen in torch.split(torch.randperm(len(inputs)), BATCH):
                readings, truth = (part[chosen] for part in whole)
                self.optimiser.zero_grad()
                torch.nn.functional.mse_loss(self.network(readings), truth).backward()  # type: ignore[no-untyped-call]
                self.optimiser.step()


class Learning(BaseCallback):
    """Trains the forecast after each rollout, and has the policy judged."""

    def __init__(self, config: PPOConfig, forecaster: Forecaster) -> None:
        super().__init__()
        self.every, self.forecaster, self.judge = config.evaluate_every, forecaster, Judge(config)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        if self.num_timesteps >= self.every * (len(self.judge.curve) + 1):
            self.judge.judge(network_policy(self.model), self.num_timesteps)

    def _on_rollout_end(self) -> None:
        buffer: Any = self.model.rollout_buffer  # type: ignore[attr-defined]
        rows = buffer.observations.reshape(-1, buffer.observations.shape[-1])
        self.forecaster.learn(rows, rows[:, self.forecaster.inputs :])


def trained(config: PPOConfig) -> Outcome:
    """Train, and return what was best."""
    with one_thread():
        torch.manual_seed(config.seed)
        seen = settings_of(config.environment, config.options).observation
        options = {"max_episode_steps": config.episode_steps, **config.options, **config.curriculum_options}
        batch = make_batch(config.environment, config.envs, options | {"observation": [*seen, *UNSEEN]})
        past = past_readings(config.lags, {name: batch.observation_blocks[name] for name in seen})
        assert past is not None
        forecaster = Forecaster.of(past, len(batch.observation_scale) - past.size)
        given = arguments(config)
        given["policy_kwargs"] |= {
            "features_extractor_class": FirstNumbers,
            "features_extractor_kwargs": {"count": forecaster.inputs},
        }
        env = VecMonitor(EncodedVecEnv(FlexArmVecEnv(batch), forecaster))
        model = PPO("MlpPolicy", env, **given, seed=config.seed, device="cpu")
        learning = Learning(config, forecaster)
        model.learn(config.steps, learning)
        learning.judge.judge(network_policy(model), model.num_timesteps)
        env.close()
    return learning.judge.outcome()
