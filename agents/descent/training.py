"""`descend`: first-order policy gradients on a batch of arms, judged by the true score, with the best policy kept."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from stable_baselines3.common.logger import Logger

from flexarm_agents.descent.config import DescentConfig
from flexarm_agents.descent.learner import Figures, Learner
from flexarm_agents.descent.observations import Observations, check_differentiable
from flexarm_agents.descent.window import Driver
from flexarm_agents.environments import make_batch, settings_of
from flexarm_agents.evaluation.scoring import StandardScore, rank
from flexarm_agents.jobs.stopping import StopSignals
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.training.checkpoint import read_parts, unpickled, write_parts
from flexarm_agents.training.rounds import Rounds
from flexarm_agents.training.run_folder import RunFolder
from flexarm_agents.training.train import Outcome, one_thread
from flexarm_agents.training.versions import versions
from flexarm_agents.training.warm_start import check_lessons

_STATE = "state.pickle"


def descend(
    config: DescentConfig, folder: str | Path | None = None, resume: bool = False, progress: bool = False
) -> Outcome:
    """Train, on one thread; the same configuration gives the same numbers on the same machine, interrupted or not.

    Args:
        config: the configuration.
        folder: for the results; None: `config.folder`. See `RunFolder` for what it holds.
        resume: go on with the interrupted training in the folder, from the round that it was in.
        progress: show a bar if stderr is a terminal; without a bar, the logger "flexarm_agents" gets a line for each
            round.

    Raises:
        TrainingStopped: a `KeyboardInterrupt`, after SIGINT (Ctrl-C) or SIGTERM in the main thread: the round that runs
            is finished and a checkpoint written. A second signal ends the process at once.
        FileExistsError: if the folder is not empty and is not to be resumed.
        FileNotFoundError: if there is no training to resume.
        ValueError: if the training in the folder has another configuration, the lessons have another observation or
            action, or derivatives do not run through one of their options.
    """
    check_lessons(config, config.lesson_options)  # this and what follows before anything is written
    check_differentiable(settings_of(config.environment, config.options | config.lesson_options))
    run = RunFolder(config.folder if folder is None else folder)
    run.enter(config, versions([__name__]), resume)
    with run.named(), one_thread(), StopSignals() as stop:
        descent = Descent(config, run)
        try:
            if run.checkpoint.exists():
                descent.load()
            return descent.go_on(config, config.all_rounds, config.steps, config.evaluation_laps, stop, progress)
        finally:
            descent.close()


class Candidate(NamedTuple):
    """A policy after its trial.

    Attributes:
        rank: of its last evaluation, smaller is better.
        driver: of its batch.
        learner: of its networks.
    """

    rank: tuple[int, float]
    driver: Driver
    learner: Learner


class Descent(Rounds):
    """A training between two rounds.

    Attributes:
        driver: of the batch.
        learner: of the networks.
        leading: the best candidate whose trial is over; None before the first, and after the last.
    """

    driver: Driver
    learner: Learner

    def __init__(self, config: DescentConfig, run: RunFolder) -> None:
        """Begin; nothing is read or written.

        Args:
            config: the configuration.
            run: folder of the training.
        """
        super().__init__(run)
        self.config, self._done = config, 0
        self.leading: Candidate | None = None
        torch.manual_seed(config.seed)
        self._begin()

    def _begin(self) -> None:
        """Begin with an untrained policy, in the episodes of the configuration's seed."""
        config = self.config
        self.driver = Driver(
            make_batch(config.environment, config.arms, config.batch_options), config.seed, config.torque_noise
        )
        self.driver.stagger(config.episode_steps)
        self.learner = self._untrained(self.driver)

    def _untrained(self, driver: Driver) -> Learner:
        """Return untrained networks for a driver's batch."""
        blocks = driver.env.observation_blocks
        own = settings_of(self.config.environment, self.config.options).observation
        return Learner(self.config, Observations(driver.env), max(blocks[name].stop for name in own))

    @property
    def done(self) -> int:
        """See `Rounds`."""
        return self._done

    def next_round(self, logger: Logger) -> None:
        """See `Rounds`."""
        trial, candidates = self.config.trial_rounds, self.config.candidates
        if candidates > 1 and 0 < self._done <= candidates * trial and self._done % trial == 0:
            self._end_trial(last=self._done == candidates * trial)
        rows = [self.window() for _ in range(self.config.windows)]
        for name, values in zip(Figures._fields, zip(*rows, strict=True), strict=True):
            logger.record(f"descent/{name}", float(np.mean(values)))
        self._done += 1

    def _end_trial(self, last: bool) -> None:
        """Remember the policy if it is the best candidate so far; go on with the next one, or after the last the best.

        Args:
            last: no other follows.
        """
        judged = StandardScore.of(self.found.rows[-1])
        present = Candidate(rank([judged]), self.driver, self.learner)
        best, other = present, self.leading
        if other is not None:
            if other.rank <= present.rank:
                best, other = other, present
            other.driver.env.close()
        if last:
            self.driver, self.learner, self.leading = best.driver, best.learner, None
        else:
            self.leading = best
            self._begin()

    def window(self) -> Figures:
        """Run a window, and learn from it."""
        return self.learner.learn(self.driver.window(self.learner.wanted, self.config.horizon))

    def policy(self) -> NetworkPolicy:
        """See `Rounds`."""
        return self.learner.policy()

    def save(self, path: Path) -> None:
        """See `Rounds`."""
        leading = self.leading
        state = {
            "found": self.found,
            "done": self._done,
            "present": (self.driver, self.learner.state()),
            "leading": None if leading is None else (leading.rank, (leading.driver, leading.learner.state())),
            "random": torch.get_rng_state(),
        }
        write_parts(path, self.config, {_STATE: pickle.dumps(state)})

    def load(self) -> None:
        """Go on from the checkpoint, which must be from a source that you trust: reading it can execute code.

        Raises:
            ValueError: if the file is not a checkpoint of such a training, or one of a version that this one cannot
                continue.
        """
        (content,) = read_parts(self.run.checkpoint, self.config, [_STATE])
        state = unpickled(self.run.checkpoint, content)
        self.close()
        self.found, self._done, leading = state["found"], state["done"], state["leading"]
        self.driver, self.learner = self._restored(*state["present"])
        self.leading = None if leading is None else Candidate(leading[0], *self._restored(*leading[1]))
        torch.set_rng_state(state["random"])

    def _restored(self, driver: Driver, learned: dict[str, Any]) -> tuple[Driver, Learner]:
        """Return a driver and its learner, from what a checkpoint has of them."""
        learner = self._untrained(driver)
        learner.restore(learned)
        return driver, learner

    def close(self) -> None:
        """Let go of the environments."""
        self.driver.env.close()
        if self.leading is not None:
            self.leading.driver.env.close()
