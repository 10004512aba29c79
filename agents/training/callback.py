"""`TrainingCallback`: evaluation, the best policy, checkpoints and progress, between the rollouts of a training."""

from __future__ import annotations

import sys
import time
from typing import Any

from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

from flexarm_agents.files import put
from flexarm_agents.jobs.stopping import StopSignals, TrainingStopped
from flexarm_agents.sb3.export import network_policy
from flexarm_agents.training.checkpoint import Progress, save_checkpoint
from flexarm_agents.training.config import TrainingConfig
from flexarm_agents.training.evaluator import Evaluator
from flexarm_agents.training.models import end_lessons, hold_policy
from flexarm_agents.training.run_folder import RunFolder


class TrainingCallback(BaseCallback):
    """Callback of `train`."""

    model: BaseAlgorithm

    def __init__(
        self, config: TrainingConfig, run: RunFolder, found: Progress, stop: StopSignals, progress: bool
    ) -> None:
        """Prepare.

        Args:
            config: configuration of the training.
            run: its folder.
            found: its progress so far, kept up to date here.
            stop: signals that stop the training between two rollouts.
            progress: show a bar if stderr is a terminal; without a bar, each evaluation is logged in a line.
        """
        super().__init__()
        self._config, self._run, self._found, self._stop = config, run, found, stop
        self._evaluator = Evaluator(config, config.evaluation_laps, run, found)
        self._began, self._before = time.perf_counter(), found.seconds
        self._before_rollout = 0  # steps
        self._with_bar = progress and sys.stderr.isatty()
        self._bar: tqdm[Any] | None = None

    def _on_training_start(self) -> None:
        if self._with_bar:
            self._bar = tqdm(total=self._config.steps, initial=self.num_timesteps, unit=" steps", unit_scale=True)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        self._before_rollout = self.num_timesteps
        self._look_after(last=False)
        if self._stop.received is not None:
            if self.num_timesteps > 0:  # before, there is nothing to go on from
                save_checkpoint(self._run.checkpoint, self._config, self.model, self._found)
            raise TrainingStopped(self._stop.received, self.num_timesteps)

    def _on_rollout_end(self) -> None:
        if self._config.value_steps:
            hold_policy(self.model, held=self.num_timesteps <= self._config.value_steps)
        end = self._config.lesson_steps
        if end is not None and self._before_rollout < end <= self.num_timesteps:
            end_lessons(self._config, self.model)

    def _on_training_end(self) -> None:
        self._look_after(last=True)
        put(self._run.last, self._evaluator.noted(network_policy(self.model)).save)

    def close(self) -> None:
        """Let go of the bar and the environment."""
        if self._bar is not None:
            self._bar.close()
        self._evaluator.close()

    def _look_after(self, last: bool) -> None:
        found, steps = self._found, self.num_timesteps
        found.seconds = self._before + time.perf_counter() - self._began
        if self._bar is not None:
            self._bar.update(steps - self._bar.n)
        if last or steps >= found.next_evaluation:
            self._evaluate()
            found.next_evaluation = _after(steps, self._config.evaluate_every)
        if last or steps >= found.next_checkpoint:
            found.next_checkpoint = _after(steps, self._config.checkpoint_every)
            save_checkpoint(self._run.checkpoint, self._config, self.model, found, complete=last)

    def _evaluate(self) -> None:
        if self._evaluator.judge(network_policy(self.model), self.num_timesteps, self.logger):
            put(self._run.best_model, self.model.save)
        if self._bar is not None:
            self._bar.set_postfix_str(self._found.state)
        else:
            self._evaluator.report()


def _after(steps: int, every: int) -> int:
    """Return the next multiple."""
    return (steps // every + 1) * every
