"""`Follow`: the work between the rollouts of a training: evaluation laps, the best policy, checkpoints, progress."""

from __future__ import annotations

import logging
import sys
import time
from typing import Any

from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

from flexarm_agents.checkpoint import Progress, save_checkpoint
from flexarm_agents.config import TrainingConfig
from flexarm_agents.environments import make_one
from flexarm_agents.export import network_policy
from flexarm_agents.network import NetworkPolicy
from flexarm_agents.run_folder import RunFolder, put
from flexarm_agents.score import StandardScore, evaluate, rank
from flexarm_agents.stopping import StopSignals, TrainingStopped

_log = logging.getLogger(__name__)
EVALUATION_SEED = 1_000_003  # not one of the training's, for any small seed


class Follow(BaseCallback):
    """Callback of `train`."""

    model: PPO

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
        self._env = make_one(config.environment, config.options)
        self._began, self._before = time.perf_counter(), found.seconds
        self._with_bar = progress and sys.stderr.isatty()
        self._bar: tqdm[Any] | None = None

    def _on_training_start(self) -> None:
        if self._with_bar:
            self._bar = tqdm(total=self._config.steps, initial=self.num_timesteps, unit=" steps", unit_scale=True)

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        self._look_after(last=False)
        if self._stop.received is not None:
            if self.num_timesteps > 0:  # before, there is nothing to go on from
                save_checkpoint(self._run.checkpoint, self.model, self._found)
            raise TrainingStopped(self._stop.received, self.num_timesteps)

    def _on_training_end(self) -> None:
        self._look_after(last=True)
        self._policy(self._found.rows[-1]).save(self._run.last)

    def close(self) -> None:
        """Let go of the bar and the environment."""
        if self._bar is not None:
            self._bar.close()
        self._env.close()

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
            save_checkpoint(self._run.checkpoint, self.model, found)

    def _evaluate(self) -> None:
        found, policy = self._found, network_policy(self.model)
        scores = [evaluate(self._env, policy, EVALUATION_SEED + n) for n in range(self._config.evaluation_laps)]
        worst = StandardScore(*(max(laps, key=lambda lap: lap.rank) for laps in zip(*scores, strict=True)))
        row = {"steps": self.num_timesteps, "seconds": round(found.seconds, 2), **worst.as_mapping()}
        found.rows.append(row)
        for lap, figures in worst.as_mapping().items():
            for name in ("rms", "maximum", "rms_after_2s", "duration"):
                if figures[name] is not None:
                    self.logger.record(f"evaluation/{lap}/{name}", figures[name])
        self.logger.dump(self.num_timesteps)
        self._run.write_evaluations(found.rows)
        if (of_these := rank(scores)) < found.best_rank:
            found.best, found.best_rank = len(found.rows) - 1, of_these
            put(self._run.best, self._policy(row).save)
            put(self._run.best_model, self.model.save)
        best = f"best {found.best_rank[1]:.3f} m" if found.best_rank[0] == 0 else "none with complete laps yet"
        if self._bar is not None:
            self._bar.set_postfix_str(best)
        else:
            _log.info("%9d steps  %6.0f s  %s; %s", self.num_timesteps, found.seconds, worst, best)

    def _policy(self, row: dict[str, Any]) -> NetworkPolicy:
        notes = {"config": self._config.plain(), "evaluation": row}
        return network_policy(self.model, notes)


def _after(steps: int, every: int) -> int:
    """Return the next multiple."""
    return (steps // every + 1) * every
