"""`EncodedVecEnv`: a batch for stable-baselines3 whose observations go through an `Encoder`."""

from __future__ import annotations

import gymnasium
import numpy as np
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnvStepReturn

from flexarm_agents.policies.encoders import Array, Encoder, Memory, encoded


class EncodedVecEnv(VecEnvWrapper):
    """Arms whose observations are an encoder's outputs.

    Attributes:
        encoder: of the observations.
        memory: of the encoder, after the last observations; empty before the first.
    """

    def __init__(self, venv: VecEnv, encoder: Encoder) -> None:
        space = gymnasium.spaces.Box(-np.inf, np.inf, (encoder.inputs,), np.float32)
        super().__init__(venv, observation_space=space)
        self.encoder = encoder
        self.memory: Memory = ()

    def reset(self) -> Array:
        """Begin an episode in every environment."""
        observations = self.venv.reset()
        assert isinstance(observations, np.ndarray)
        inputs, self.memory = self.encoder.reset(observations)
        return inputs

    def step_wait(self) -> VecEnvStepReturn:
        """Return the results of the step; the last observation of an episode is encoded, too."""
        observations, rewards, dones, infos = self.venv.step_wait()
        assert isinstance(observations, np.ndarray)
        ended = np.flatnonzero(dones)
        if len(ended):
            before = tuple(part[ended] for part in self.memory)
            last, _ = self.encoder.advance(np.stack([infos[i]["terminal_observation"] for i in ended]), before)
            for i, one in zip(ended, last, strict=True):
                infos[i]["terminal_observation"] = one
        inputs, self.memory = encoded(self.encoder, observations, self.memory, dones)
        return inputs, rewards, dones, infos
