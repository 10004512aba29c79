"""`Rounds`: a training in rounds, each of which ends with an evaluation and a checkpoint."""

from __future__ import annotations

import sys
import time
from abc import ABC, abstractmethod
from pathlib import Path

from stable_baselines3.common.logger import Logger, configure
from tqdm import tqdm

from flexarm_agents.files import put
from flexarm_agents.jobs.stopping import StopSignals, TrainingStopped
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.training.config import RunConfig
from flexarm_agents.training.evaluator import Evaluator, TrainingProgress
from flexarm_agents.training.run_folder import RunFolder
from flexarm_agents.training.train import Outcome


class Rounds(ABC):
    """A training between two rounds.

    Attributes:
        run: its folder.
        found: progress so far.
    """

    def __init__(self, run: RunFolder) -> None:
        """Begin.

        Args:
            run: folder of the training.
        """
        self.run, self.found = run, TrainingProgress()

    @property
    @abstractmethod
    def done(self) -> int:
        """Rounds so far."""

    @abstractmethod
    def next_round(self, logger: Logger) -> None:
        """Run the next round, and record its figures."""

    @abstractmethod
    def policy(self) -> NetworkPolicy:
        """Return the present policy."""

    @abstractmethod
    def save(self, path: Path) -> None:
        """Write a checkpoint."""

    def go_on(
        self, config: RunConfig, rounds: int, steps: int, laps: int, stop: StopSignals, progress: bool
    ) -> Outcome:
        """Run the rounds that are left.

        Args:
            config: of the training.
            rounds: of the whole training.
            steps: environment steps of a round.
            laps: how often an evaluation runs each of the two standard laps.
            stop: signals that stop the training between two rounds.
            progress: show a bar if stderr is a terminal; without a bar, each evaluation is logged in a line.

        Raises:
            TrainingStopped: after a signal.
        """
        found, began, before = self.found, time.perf_counter(), self.found.seconds
        logger = configure(str(self.run.logs), ["tensorboard"])
        evaluator = Evaluator(config, laps, self.run, found)
        with_bar = progress and sys.stderr.isatty()
        bar = tqdm(total=rounds, initial=self.done, unit=" rounds") if with_bar else None
        try:
            while self.done < rounds:
                self.next_round(logger)
                found.seconds = before + time.perf_counter() - began
                evaluator.judge(self.policy(), steps * self.done, logger)
                if bar is not None:
                    bar.update()
                    bar.set_postfix_str(found.state)
                else:
                    evaluator.report()
                self.save(self.run.checkpoint)
                if stop.received is not None and self.done < rounds:
                    raise TrainingStopped(stop.received, steps * self.done)
            put(self.run.last, evaluator.noted(self.policy()).save)
        finally:
            evaluator.close()
            logger.close()
            if bar is not None:
                bar.close()
        assert found.best is not None
        return Outcome(self.run.path, found.rows[found.best], found.rows[-1])
