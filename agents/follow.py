"""`Follow`: looks after a training between its rollouts: evaluation laps, the best policy, checkpoints, the bar."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from tqdm import tqdm

from flexarm_agents.checkpoint import Progress, save_checkpoint
from flexarm_agents.config import TrainingConfig
from flexarm_agents.environments import make_one
from flexarm_agents.export import network_policy
from flexarm_agents.network import NetworkPolicy
from flexarm_agents.run_folder import RunFolder, put
from flexarm_agents.score import Score, evaluate

EVALUATION_SEED = 1_000_003  # not one of the training's, for any small seed


class Follow(BaseCallback):
    """Callback of `train`."""

    model: PPO

    def __init__(self, config: TrainingConfig, run: RunFolder, found: Progress, progress: bool) -> None:
        """Prepare.

        Args:
            config: of the training.
            run: its folder.
            found: its progress so far, kept up to date here.
            progress: show a bar where there is a terminal.
        """
        super().__init__()
        self._config, self._run, self._found = config, run, found
        self._env = make_one(config.environment, config.options)
        self._shown, self._began, self._before = progress, time.perf_counter(), found.seconds
        self._bar: tqdm[Any] | None = None

    def _on_training_start(self) -> None:
        self._env.reset()  # compiles, if need be
        self._began = time.perf_counter()
        self._bar = tqdm(
            total=self._config.steps,
            initial=self.num_timesteps,
            unit=" steps",
            unit_scale=True,
            disable=None if self._shown else True,
        )

    def _on_step(self) -> bool:
        return True

    def _on_rollout_start(self) -> None:
        self._look_after(last=False)

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
        laps = [evaluate(self._env, policy, EVALUATION_SEED + n) for n in range(self._config.evaluation_laps)]
        worst = max(laps, key=lambda each: each.rank)  # is what the files tell
        row = {"steps": self.num_timesteps, "seconds": round(found.seconds, 2), **worst.plain()}
        found.rows.append(row)
        for name in ("rms", "maximum", "rms_after_2s", "duration"):
            if row[name] is not None:
                self.logger.record(f"evaluation/{name}", row[name])
        self.logger.dump(self.num_timesteps)
        self._run.write_evaluations(found.rows)
        if (rank := _rank(laps)) < found.best_rank:
            found.best, found.best_rank = len(found.rows) - 1, rank
            put(self._run.best, self._policy(row).save)
            put(self._run.best_model, self.model.save)
        if self._bar is not None and found.best_rank[0] == 0:
            self._bar.set_postfix_str(f"best lap {found.best_rank[1]:.3f} m r.m.s.")

    def _policy(self, row: dict[str, Any]) -> NetworkPolicy:
        notes = {"config": self._config.plain(), "evaluation": row}
        return network_policy(self.model, notes)


def _after(steps: int, every: int) -> int:
    """The next multiple."""
    return (steps // every + 1) * every


def _rank(laps: list[Score]) -> tuple[int, float]:
    """Of several episodes: how many ended early, then their mean rank."""
    early = sum(not lap.complete for lap in laps)
    return early, float(np.mean([lap.rank[1] for lap in laps if lap.complete == (early == 0)]))
