"""`FlexArmVecEnv`: a batch of arms for stable-baselines3, which does not take Gymnasium's vector environments.

It behaves as `DummyVecEnv` over single environments does, to the last bit (environment i of a batch seeded s is the
single one seeded s + i), at a fraction of the time.
"""

import os
from collections.abc import Sequence
from dataclasses import fields
from difflib import get_close_matches
from typing import Any, Literal, Self

import gymnasium
import numpy as np
import torch
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnvWrapper
from stable_baselines3.common.vec_env.base_vec_env import VecEnv, VecEnvIndices, VecEnvStepReturn

from flexarm_agents.environments import make_batch
from flexarm_agents.policies.encoders import Array, Encoder, Memory, encoded
from flexarm_env.envs.info import Episode
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.validation import choice, shown

Observations = NDArray[np.float32]
Infos = Literal["final", "all"]
INFOS = ("final", "all")
_OF_BATCHES = ("final_obs", "final_info")
_THREADS = "OMP_NUM_THREADS"  # of the process's environment: how many threads torch takes
_SINGLE = {"observation_space": "single_observation_space", "action_space": "single_action_space"}


class FlexArmVecEnv(VecEnv):
    """N arms for stable-baselines3.

    Episodes begin in the step that ends the one before. What ended is in that environment's info:
    `terminal_observation`, `TimeLimit.truncated` (the time limit alone ended it, so its value is bootstrapped) and the
    step's own info; `reset_infos` holds the info of each environment's last reset.

    `set_options({"parameters": {"delay": 0.02}})` is for the episodes that the next `reset()` begins. For later ones
    `set_attr("randomisation", ranges)` narrows ranges, and `env.set_options` takes the options of a reset. For
    other options make another batch and give it to the model by `set_env`.

    Attributes:
        env: the vector environment, made with `autoreset_mode="SameStep"`.
        infos: "final" (only environments whose episode ended carry an info, the others an empty one: cheap) or "all".
    """

    def __init__(self, env: FlexArmVectorEnv, infos: Infos = "final") -> None:
        if not isinstance(env, FlexArmVectorEnv):
            raise TypeError(f"env = {shown(env)}: must be a FlexArmVectorEnv, not wrapped")
        if env.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise ValueError(f"env.autoreset_mode = {env.autoreset_mode.value!r}: must be 'SameStep'")
        self.env = env
        self.infos = choice("infos", infos, INFOS)
        self._actions: NDArray[Any] | None = None
        self._begun = False
        super().__init__(env.num_envs, env.single_observation_space, env.single_action_space)
        self.metadata = dict(env.metadata)

    @classmethod
    def make(cls, environment: str, num_envs: int, infos: Infos = "final", **options: Any) -> Self:
        """Make the batch of a registered id, with its time limit.

        Args:
            environment: e.g. "FlexArm/Square-v0".
            num_envs: how many.
            infos: see the class.
            **options: options of the environment, or `max_episode_steps`, `render_mode`, `threads`.
        """
        choice("infos", infos, INFOS)
        return cls(make_batch(environment, num_envs, options), infos)

    # --- running ---------------------------------------------------------------------------------------------------

    def reset(self) -> Observations:
        """Begin an episode in every environment, with what `seed` and `set_options` left for this reset."""
        seeds, options = list(self._seeds), list(self._options)
        self._reset_seeds()
        self._reset_options()
        if len(options) != self.num_envs:
            raise ValueError(f"options: must be one mapping or {self.num_envs}, one for each, got {len(options)}")
        alike = not any(options) or all(each is options[0] for each in options)  # `set_options` with one for all
        if not self._begun:
            _warn_of_threads()
        if alike or not self._begun:  # the first reset must be of all
            observations, infos = self.env.reset(seed=seeds, options=(alike and options[0]) or None)
            self.reset_infos = [_info_of(infos, i) for i in range(self.num_envs)]
            self._begun = True
        if alike:
            return observations
        for i in range(self.num_envs):
            observations = self._reset_one(i, seed=seeds[i], options=options[i])
        return observations

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take actions for `step_wait`. Shape (N, channels)."""
        self._actions = actions

    def step_wait(self) -> VecEnvStepReturn:
        """Hold the actions for one control period.

        Returns:
            Observations (N, k) float32, rewards (N,) float32, dones (N,) bool, infos.

        Raises:
            RuntimeError: without `step_async`.
        """
        if self._actions is None:
            raise RuntimeError("step_wait() before step_async(): there are no actions")
        actions, self._actions = self._actions, None
        observations, rewards, terminated, truncated, infos = self.env.step(actions)
        done = terminated | truncated
        if self.infos == "all":
            entries = [{**_info_of(infos, i), "TimeLimit.truncated": False} for i in range(self.num_envs)]
        else:
            entries = [{} for _ in range(self.num_envs)]
        for i in np.flatnonzero(done).tolist():
            self.reset_infos[i] = _info_of(infos, i)
            entries[i] = _info_of(infos["final_info"], i)
            entries[i]["terminal_observation"] = infos["final_obs"][i]
            entries[i]["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
        return observations, rewards.astype(np.float32), done, entries

    def close(self) -> None:
        """Let go of threads and windows."""
        self.env.close()

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Draw a picture of each environment, shape (size, size, 3); None without render mode."""
        drawn = None if self.render_mode is None else self.env.render()  # without one, `render` warns
        return drawn or [None] * self.num_envs

    # --- attributes and methods through a VecEnv -------------------------------------------------------------------

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Return an attribute of each environment; all share their attributes but `episode`.

        Args:
            attr_name: name of an attribute of the vector environment; `observation_space` and `action_space` mean those
                of one.
            indices: which environments; None: all.

        Raises:
            AttributeError: there is none of this name.
        """
        value = getattr(self.env, _SINGLE.get(attr_name, attr_name))
        return [value.one(i) if isinstance(value, Episode) else value for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the vector environment.

        Raises:
            AttributeError: for an option, which is fixed when the batch is made, but `randomisation`; for a new name
                that resembles an option's.
            ValueError: for some environments only; they share their attributes.
        """
        options = [one.name for one in fields(Settings)]
        if (
            attr_name not in options
            and not self.has_attr(attr_name)
            and (near := get_close_matches(attr_name, options, 1, 0.8))
        ):
            raise AttributeError(f"attr_name = {shown(attr_name)}: no such attribute; did you mean {shown(near[0])}?")
        if attr_name != "randomisation" and attr_name in options:
            raise AttributeError(
                f"attr_name = {shown(attr_name)}: an option, fixed when the batch is made; make another batch and give "
                "it to the model by `set_env`, or the next reset its quantities by `set_options({'parameters': ...})`"
            )
        self._check_all(indices, attr_name)
        if attr_name == "randomisation":
            self.env.set_options({attr_name: value})
        else:
            setattr(self.env, attr_name, value)

    def env_method(
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method as if it were each environment's own.

        Args:
            method_name: `render` (returns pictures), `reset` (of these environments, each with the same arguments;
                returns observation and info), `set_options` (of all, for all later episodes, as of the vector
                environment), or `get_wrapper_attr` and `has_wrapper_attr` with a name.
            *method_args: arguments of the method.
            indices: which environments; None: all.
            **method_kwargs: keyword arguments of the method.
        """
        chosen = [int(i) for i in self._get_indices(indices)]
        if method_name == "set_options":
            self._check_all(indices, method_name)
            self.env.set_options(*method_args, **method_kwargs)
            return [None] * len(chosen)
        if method_name == "render":
            images = self.get_images()
            return [images[i] for i in chosen]
        if method_name == "get_wrapper_attr":
            return self.get_attr(method_args[0], chosen)
        if method_name == "has_wrapper_attr":
            return [self.has_attr(method_args[0])] * len(chosen)
        if method_name == "reset":
            return [(self._reset_one(i, *method_args, **method_kwargs)[i], self.reset_infos[i]) for i in chosen]
        raise AttributeError(
            f"method_name = {shown(method_name)}: "
            "must be one of 'render', 'reset', 'set_options', 'get_wrapper_attr', 'has_wrapper_attr'"
        )

    def env_is_wrapped(
        self, wrapper_class: type[gymnasium.Wrapper[Any, Any, Any, Any]], indices: VecEnvIndices = None
    ) -> list[bool]:
        """Return whether a Gymnasium wrapper is around each environment: none is, the time limit is built in."""
        return [False for _ in self._get_indices(indices)]

    def _check_all(self, indices: VecEnvIndices, name: str) -> None:
        if sorted(set(self._get_indices(indices))) != list(range(self.num_envs)):
            raise ValueError(
                f"indices = {shown(indices)}: must be None; the environments share the attribute {shown(name)}"
            )

    def _reset_one(self, index: int, *, seed: int | None = None, options: dict[str, Any] | None = None) -> Observations:
        """Begin an episode in one environment; return the observations of all."""
        own = {**(options or {}), "reset_mask": np.arange(self.num_envs) == index}
        observations, infos = self.env.reset(seed=[seed] * self.num_envs, options=own)
        self.reset_infos[index] = _info_of(infos, index)
        return observations


def _info_of(infos: dict[str, Any], index: int) -> dict[str, Any]:
    """Return the info of one environment of a batch as the single one would give it; arrays are copies."""
    own = [name for name in infos if not name.startswith("_") and name not in _OF_BATCHES and infos[f"_{name}"][index]]
    return {name: infos[name][index].copy() for name in own}


def _warn_of_threads() -> None:
    """Warn if torch takes several threads and their number was not chosen."""
    if (threads := torch.get_num_threads()) > 1 and _THREADS not in os.environ:
        gymnasium.logger.warn(
            f"torch uses {threads} threads. On networks of the usual size they mostly wait for each other: no faster "
            "than one on an idle machine, and many times slower on a busy one or under a limit of its processors. Call "
            f"torch.set_num_threads(1) before the training, or set {_THREADS} to the number that you want"
        )


class EncodedVecEnv(VecEnvWrapper):
    """Encodes observations: the encoder's outputs, then the numbers that it does not take. `memory` is () at first."""

    def __init__(self, venv: VecEnv, encoder: Encoder) -> None:
        size = encoder.inputs + venv.observation_space.shape[0] - encoder.size  # type: ignore[index]
        space = gymnasium.spaces.Box(-np.inf, np.inf, (size,), np.float32)
        super().__init__(venv, observation_space=space)
        self.encoder = encoder
        self.memory: Memory = ()

    def reset(self) -> Array:
        """Begin an episode in every environment."""
        observations = self.venv.reset()
        assert isinstance(observations, np.ndarray)
        inputs, self.memory = self.encoder.reset(observations[:, : self.encoder.size])
        return self._whole(inputs, observations)

    def step_wait(self) -> VecEnvStepReturn:
        """Return the results of the step; the last observation of an episode is encoded, too."""
        observations, rewards, dones, infos = self.venv.step_wait()
        assert isinstance(observations, np.ndarray)
        ended = np.flatnonzero(dones)
        if len(ended):
            before = tuple(part[ended] for part in self.memory)
            last = np.stack([infos[i]["terminal_observation"] for i in ended])
            inputs, _ = self.encoder.advance(last[:, : self.encoder.size], before)
            for i, one in zip(ended, self._whole(inputs, last), strict=True):
                infos[i]["terminal_observation"] = one
        inputs, self.memory = encoded(self.encoder, observations[:, : self.encoder.size], self.memory, dones)
        return self._whole(inputs, observations), rewards, dones, infos

    def _whole(self, inputs: Array, observations: Array) -> Array:
        return np.concatenate([inputs, observations[:, self.encoder.size :]], axis=1)
