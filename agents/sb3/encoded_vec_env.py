"""`EncodedVecEnv`: a batch for stable-baselines3 whose observations go through an `encoders.Encoder`."""

from __future__ import annotations

import gymnasium
import numpy as np
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from flexarm_agents.policies.encoders import Encoder, Memory, resumed
from flexarm_agents.policies.history import Array


class EncodedVecEnv(VecEnvWrapper):
    """Arms whose observations are an encoder's inputs for the network.

    Attributes:
        encoder: what makes them.
        memory: of the encoder, after the last observations; none before the first.
    """

    def __init__(self, venv: VecEnv, encoder: Encoder) -> None:
        """Put the encoder over a batch.

        Args:
            venv: the batch.
            encoder: for its observations.
        """
        space = gymnasium.spaces.Box(-np.inf, np.inf, (encoder.inputs,), np.float32)
        super().__init__(venv, observation_space=space)
        self.encoder = encoder
        self.memory: Memory = ()

    def reset(self) -> Array:
        """Begin an episode in every environment."""
        observations = self.venv.reset()
        assert isinstance(observations, np.ndarray)
        inputs, self.memory = self.encoder.begin(observations)
        return inputs

    def step_wait(self) -> VecEnvStepReturn:
        """Return what the step gave; also the last observation of an episode goes through the encoder."""
        observations, rewards, dones, infos = self.venv.step_wait()
        assert isinstance(observations, np.ndarray)
        if not dones.any():
            inputs, self.memory = self.encoder.go_on(observations, self.memory)
            return inputs, rewards, dones, infos
        ended = np.flatnonzero(dones)
        before = tuple(part[ended] for part in self.memory)
        last, _ = self.encoder.go_on(np.stack([infos[i]["terminal_observation"] for i in ended]), before)
        for i, one in zip(ended, last, strict=True):
            infos[i]["terminal_observation"] = one
        inputs, self.memory = resumed(self.encoder, observations, self.memory, dones)
        return inputs, rewards, dones, infos
