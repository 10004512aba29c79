"""`RewardTraining`: PPO, RecurrentPPO, SAC and TQC, as stable-baselines3 and sb3-contrib have them."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import Any

from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecMonitor, unwrap_vec_wrapper

from flexarm_agents.environments import settings_of
from flexarm_agents.files import put
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.sb3.export import network_policy, set_network
from flexarm_agents.sb3.vec_env import EncodedVecEnv, FlexArmVecEnv
from flexarm_agents.training.algorithms import PPOConfig, RewardConfig
from flexarm_agents.training.loop import Training
from flexarm_agents.training.models import batch_for, end_curriculum, hold_policy, model_class, new_model
from flexarm_agents.training.randomisation import Width
from flexarm_agents.training.run_folder import RunFolder
from flexarm_agents.training.warm_start import check_curriculum, initial_policy

_KEPT = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")  # arrays of a replay buffer


class TrainingCallback(BaseCallback):
    """Calls `pause` before each rollout; ends the curriculum and the value's own steps, and widens ranges."""

    model: BaseAlgorithm

    def __init__(self, training: RewardTraining, pause: Callable[[], None]) -> None:
        super().__init__()
        self._training, self._config, self._pause = training, training.config, pause
        self._before = 0  # steps before the rollout

    def _on_step(self) -> bool:
        if (width := self._training.width) is not None:
            self._training.width = width.after(self.locals["dones"], self.locals["infos"])
        return True

    def _on_rollout_start(self) -> None:
        self._before = self.num_timesteps
        self._pause()

    def _on_rollout_end(self) -> None:
        if isinstance(self._config, PPOConfig) and self._config.value_steps:
            hold_policy(self.model, held=self.num_timesteps <= self._config.value_steps)
        end = self._config.curriculum_steps
        if end is not None and self._before < end <= self.num_timesteps:
            end_curriculum(self._config, self.model)
        if (width := self._training.width) is not None and (decided := width.decided()) is not width:
            self._training.width = decided
            widen(self._config, self.model, decided)
            self.logger.record("randomisation/width", decided.share)


def widen(config: RewardConfig, model: BaseAlgorithm, width: Width) -> None:
    """Draw the episodes to come from ranges of a width."""
    settings = settings_of(config.environment, config.options | config.curriculum_options)
    env = model.get_env()
    assert env is not None
    env.set_attr("randomisation", width.ranges(settings))


class RewardTraining(Training):
    """A training by reward; its parts are rollouts. The model is None before `start` or `restore`."""

    model: BaseAlgorithm | None = None
    width: Width | None = None  # of the ranges, where they widen

    def __init__(self, config: RewardConfig, run: RunFolder) -> None:
        """Check the algorithm's package, the curriculum and the initial policy; see `Training`."""
        super().__init__(config, run)
        model_class(config)
        check_curriculum(config)
        self._initial: NetworkPolicy | None = None
        if isinstance(config, PPOConfig) and not run.checkpoint.exists():
            self._initial = initial_policy(config, run)

    @property
    def steps(self) -> int:
        """See `Training`."""
        return 0 if self.model is None else self.model.num_timesteps

    @property
    def total(self) -> int:
        """See `Training`."""
        return int(self.config.steps)

    def start(self) -> None:
        """See `Training`."""
        self.model = new_model(self.config)
        if self.config.automatic_randomisation:
            self.width = Width()
        if self._initial is not None:
            put(self.run.initial, self._initial.save)
            set_network(self.model, self._initial)

    def learn(self, pause: Callable[[], None]) -> None:
        """See `Training`."""
        assert self.model is not None
        self.model.set_logger(self.logger)
        if self.width is not None:
            widen(self.config, self.model, self.width)
        callback = TrainingCallback(self, pause)
        self.model.learn(self.total - self.steps, callback, reset_num_timesteps=self.steps == 0)

    def policy(self) -> NetworkPolicy:
        """See `Training`."""
        assert self.model is not None
        return network_policy(self.model)

    def keep_best(self) -> None:
        """Keep the model of the library, too."""
        assert self.model is not None
        put(self.run.best_model, self.model.save)

    def state(self, complete: bool) -> dict[str, Any]:
        """See `Training`."""
        model = self.model
        assert model is not None
        monitor = model.get_env()
        assert isinstance(monitor, VecMonitor)
        batch = monitor.unwrapped
        assert isinstance(batch, FlexArmVecEnv)
        encoded = unwrap_vec_wrapper(monitor, EncodedVecEnv)
        saved = io.BytesIO()
        model.save(saved)
        return {
            "model": saved.getvalue(),
            "action_space": model.action_space,  # its generator draws the actions before the first update
            "env": batch.env,
            "encoder": () if encoded is None else encoded.memory,
            "episodes": (monitor.episode_returns, monitor.episode_lengths),
            "lstm": getattr(model, "_last_lstm_states", None),
            "replay": None if complete else _replay(model),
            "width": self.width,
        }

    def restore(self, state: dict[str, Any]) -> None:
        """See `Training`."""
        monitor = VecMonitor(batch_for(self.config, state["env"]))
        monitor.episode_returns, monitor.episode_lengths = state["episodes"]
        encoded = unwrap_vec_wrapper(monitor, EncodedVecEnv)
        if encoded is not None:
            encoded.memory = state["encoder"]
        saved = io.BytesIO(state["model"])
        model = model_class(self.config).load(saved, env=monitor, device="cpu", force_reset=False)
        model.action_space = state["action_space"]
        if state["lstm"] is not None:
            model._last_lstm_states = state["lstm"]
        _restore_replay(model, state["replay"])
        self.model, self.width = model, state.get("width")  # earlier versions wrote none

    def close(self) -> None:
        """See `Training`."""
        if self.model is not None and (env := self.model.get_env()) is not None:
            env.close()


def _replay(model: BaseAlgorithm) -> dict[str, Any] | None:
    """Return the filled part of a replay buffer; None for an algorithm without one."""
    buffer = getattr(model, "replay_buffer", None)
    if not isinstance(buffer, ReplayBuffer):
        return None
    arrays = {name: getattr(buffer, name)[: buffer.size()].copy() for name in _KEPT}
    return {"pos": buffer.pos, "full": buffer.full, "arrays": arrays}


def _restore_replay(model: BaseAlgorithm, kept: dict[str, Any] | None) -> None:
    buffer = getattr(model, "replay_buffer", None)
    if kept is None or not isinstance(buffer, ReplayBuffer):
        return
    buffer.pos, buffer.full = kept["pos"], kept["full"]
    for name, values in kept["arrays"].items():
        getattr(buffer, name)[: len(values)] = values
