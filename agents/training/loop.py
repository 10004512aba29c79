"""`Training`: a training of one algorithm, part by part; `TrainingLoop`: what is done between two parts."""

from __future__ import annotations

import random
import sys
import time
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.logger import Logger, configure
from tqdm import tqdm

from flexarm_agents.files import put
from flexarm_agents.jobs.stopping import StopSignals, TrainingStopped
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.training.checkpoint import read_checkpoint, write_checkpoint
from flexarm_agents.training.config import RunConfig
from flexarm_agents.training.evaluator import Evaluator, TrainingProgress
from flexarm_agents.training.run_folder import RunFolder


class Training(ABC):
    """A training of one algorithm. It consists of parts (rollouts, or rounds), between which it can be resumed.

    Attributes:
        config: the configuration.
        run: its folder.
        progress: what was found so far.
        logger: of the figures for TensorBoard.
    """

    config: Any  # of the algorithm's own class
    logger: Logger

    def __init__(self, config: RunConfig, run: RunFolder) -> None:
        """Check that the training is possible; nothing is written.

        Args:
            config: the configuration.
            run: folder of the training.
        """
        self.config, self.run, self.progress = config, run, TrainingProgress()

    @property
    @abstractmethod
    def steps(self) -> int:
        """Environment steps so far."""

    @property
    @abstractmethod
    def total(self) -> int:
        """Environment steps of the whole training."""

    @property
    def evaluate_every(self) -> int:
        """Environment steps between two evaluations."""
        return int(self.config.evaluate_every)

    @property
    def checkpoint_every(self) -> int:
        """Environment steps between two checkpoints."""
        return int(self.config.checkpoint_every)

    @abstractmethod
    def start(self) -> None:
        """Make environments and untrained networks."""

    @abstractmethod
    def learn(self, pause: Callable[[], None]) -> None:
        """Train to the end.

        Args:
            pause: to be called before each part.
        """

    @abstractmethod
    def policy(self) -> NetworkPolicy:
        """Return the present policy."""

    @abstractmethod
    def state(self, complete: bool) -> dict[str, Any]:
        """Return what a checkpoint keeps, by name.

        Args:
            complete: the training is over, so that nothing is needed that is only for learning.
        """

    @abstractmethod
    def restore(self, state: dict[str, Any]) -> None:
        """Make environments and networks as they were.

        Args:
            state: what `state` returned.
        """

    @abstractmethod
    def close(self) -> None:
        """Close the environments, if they were made."""

    @abstractmethod
    def keep_best(self) -> None:
        """Keep more of the best policy than its numbers, where the algorithm has more."""

    def save(self, complete: bool) -> None:
        """Write a checkpoint between two parts."""
        generators = (random.getstate(), np.random.get_state(), torch.get_rng_state())  # noqa: NPY002  (SB3 uses it)
        kept = {"progress": asdict(self.progress), "random": generators, "state": self.state(complete)}
        write_checkpoint(self.run.checkpoint, self.config, kept)

    def load(self) -> None:
        """Continue from the checkpoint, which must be from a source that you trust: reading it can execute code.

        The global random generators are set to their states of then.

        Raises:
            ValueError: if the file is not a checkpoint of such a training, or this version cannot continue it.
        """
        kept = read_checkpoint(self.run.checkpoint, self.config)
        self.progress = TrainingProgress(**kept["progress"])
        self.restore(kept["state"])
        python, numpy, torch_state = kept["random"]
        random.setstate(python)
        np.random.set_state(numpy)  # noqa: NPY002
        torch.set_rng_state(torch_state)


class Rounds(Training):
    """A training in rounds, each of which ends with an evaluation and a checkpoint."""

    @property
    @abstractmethod
    def done(self) -> int:
        """Rounds so far."""

    @property
    @abstractmethod
    def rounds(self) -> int:
        """Rounds of the whole training."""

    @property
    @abstractmethod
    def round_steps(self) -> int:
        """Environment steps of a round."""

    @abstractmethod
    def next_round(self) -> None:
        """Run the next round, and record its figures."""

    @property
    def steps(self) -> int:
        """See `Training`."""
        return self.done * self.round_steps

    @property
    def total(self) -> int:
        """See `Training`."""
        return self.rounds * self.round_steps

    @property
    def evaluate_every(self) -> int:
        """See `Training`."""
        return self.round_steps

    @property
    def checkpoint_every(self) -> int:
        """See `Training`."""
        return self.round_steps

    def keep_best(self) -> None:
        """Keep nothing: the policy's numbers are all."""

    def learn(self, pause: Callable[[], None]) -> None:
        """See `Training`."""
        while self.done < self.rounds:
            pause()
            self.next_round()


class TrainingLoop:
    """Evaluation laps, the best policy, checkpoints, progress and signals between the parts of a training."""

    def __init__(self, training: Training, stop: StopSignals, progress: bool) -> None:
        """Prepare.

        Args:
            training: made, or loaded from its checkpoint.
            stop: signals that stop the training between two parts.
            progress: show a bar if stderr is a terminal; without a bar, each evaluation is logged in a line.
        """
        self._training, self._stop = training, stop
        training.logger = configure(str(training.run.logs), ["tensorboard"])
        self._evaluator = Evaluator(training.config, training.run, training.progress)
        self._began, self._before = time.perf_counter(), training.progress.seconds
        with_bar = progress and sys.stderr.isatty()
        steps = {"initial": training.steps, "total": training.total, "unit": " steps", "unit_scale": True}
        self._bar = tqdm(**steps) if with_bar else None

    def run(self) -> None:
        """Train to the end.

        Raises:
            TrainingStopped: after a signal.
        """
        training = self._training
        if training.steps < training.total:
            training.learn(self._pause)
            self._attend(last=True)

    def close(self) -> None:
        """Close files, environments and the bar."""
        if self._bar is not None:
            self._bar.close()
        self._evaluator.close()
        self._training.logger.close()

    def _pause(self) -> None:
        training, signal = self._training, self._stop.received
        self._attend(last=False)
        if signal is not None:
            if training.steps > 0:  # before, there is nothing to keep
                training.save(complete=False)
            raise TrainingStopped(signal, training.steps)

    def _attend(self, last: bool) -> None:
        """Evaluate and save where it is due, and show the progress."""
        training, found = self._training, self._training.progress
        found.seconds = self._before + time.perf_counter() - self._began
        if self._bar is not None:
            self._bar.update(training.steps - self._bar.n)
        if last or training.steps >= (found.next_evaluation or training.evaluate_every):
            self._evaluate()
            found.next_evaluation = _after(training.steps, training.evaluate_every)
        if last:
            put(training.run.last, self._evaluator.noted(training.policy()).save)
        if last or training.steps >= (found.next_checkpoint or training.checkpoint_every):
            found.next_checkpoint = _after(training.steps, training.checkpoint_every)
            training.save(complete=last)

    def _evaluate(self) -> None:
        training = self._training
        if self._evaluator.judge(training.policy(), training.steps, training.logger):
            training.keep_best()
        if self._bar is not None:
            self._bar.set_postfix_str(training.progress.state)
        else:
            self._evaluator.report()


def _after(steps: int, every: int) -> int:
    """Return the next multiple."""
    return (steps // every + 1) * every
