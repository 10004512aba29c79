"""`train`: reinforcement learning on a batch of arms, judged by the true score, with the best policy kept."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from stable_baselines3.common.logger import configure

from flexarm_agents.files import put
from flexarm_agents.jobs.stopping import StopSignals
from flexarm_agents.sb3.export import set_network
from flexarm_agents.training.callback import TrainingCallback
from flexarm_agents.training.checkpoint import Progress, load_checkpoint
from flexarm_agents.training.config import TrainingConfig
from flexarm_agents.training.models import model_class, new_model
from flexarm_agents.training.run_folder import RunFolder
from flexarm_agents.training.versions import versions
from flexarm_agents.training.warm_start import check_lessons, initial_policy


@dataclass(frozen=True)
class Outcome:
    """What a training gave.

    Attributes:
        folder: where it lies.
        best: the evaluation of the best policy, a row of `evaluations.json`.
        last: the evaluation of the last one.
    """

    folder: Path
    best: dict[str, Any]
    last: dict[str, Any]


def train(
    config: TrainingConfig, folder: str | Path | None = None, resume: bool = False, progress: bool = False
) -> Outcome:
    """Train, on one thread; the same configuration gives the same numbers on the same machine, interrupted or not.

    Args:
        config: the configuration.
        folder: for the results; None: `config.folder`. See `RunFolder` for what it holds.
        resume: go on with the interrupted training in the folder, from its last checkpoint.
        progress: show a bar if stderr is a terminal; without a bar, the logger "flexarm_agents" gets a line for each
            evaluation.

    Raises:
        TrainingStopped: a `KeyboardInterrupt`, after SIGINT (Ctrl-C) or SIGTERM in the main thread: the rollout that
            runs is finished and a checkpoint written. A second signal ends the process at once.
        ModuleNotFoundError: without the algorithm's package, naming the extra.
        FileExistsError: if the folder is not empty and is not to be resumed.
        FileNotFoundError: if there is no training to resume, or no such initial policy.
        ValueError: if the training in the folder has another configuration, or lessons or the initial policy do not
            fit it.
    """
    run = RunFolder(config.folder if folder is None else folder)
    model_class(config.algorithm)  # this and what follows before anything is written
    check_lessons(config, config.lesson_options)
    first = None if run.checkpoint.exists() else initial_policy(config, run)
    run.enter(config, versions([__name__]), resume)
    if first is not None:
        put(run.initial, first.save)
    with run.named(), one_thread(), StopSignals() as stop:
        if run.checkpoint.exists():
            model, found = load_checkpoint(run.checkpoint, config)
        else:
            model = new_model(config)
            if first is not None:
                set_network(model, first)
            found = Progress(next_evaluation=config.evaluate_every, next_checkpoint=config.checkpoint_every)
        model.set_logger(configure(str(run.logs), ["tensorboard"]))
        follow = TrainingCallback(config, run, found, stop, progress)
        try:
            if model.num_timesteps < config.steps:
                fresh = model.num_timesteps == 0
                model.learn(config.steps - model.num_timesteps, follow, reset_num_timesteps=fresh)
        finally:
            follow.close()
            model.logger.close()
            if (env := model.get_env()) is not None:
                env.close()
    assert found.best is not None
    return Outcome(run.path, found.rows[found.best], found.rows[-1])


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit torch to one thread: on small networks more of them only wait for each other."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
