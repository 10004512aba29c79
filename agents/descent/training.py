"""`descend`: first-order policy gradients on a batch of arms, judged by the true score, with the best policy kept."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import torch
from stable_baselines3.common.logger import Logger

from flexarm_agents.beginnings import check_lessons
from flexarm_agents.checkpoint import read_parts, unpickled, write_parts
from flexarm_agents.descent.config import DescentConfig
from flexarm_agents.descent.learner import Figures, Learner
from flexarm_agents.descent.observations import Observations, check_differentiable
from flexarm_agents.descent.window import Driver
from flexarm_agents.environments import make_batch, settings_of
from flexarm_agents.network import NetworkPolicy
from flexarm_agents.rounds import Rounds
from flexarm_agents.run_folder import RunFolder
from flexarm_agents.stopping import StopSignals
from flexarm_agents.training import Outcome, one_thread
from flexarm_agents.versions import versions

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
    with one_thread(), StopSignals() as stop:
        descent = Descent(config, run)
        try:
            if run.checkpoint.exists():
                descent.load()
            return descent.go_on(config, config.rounds, config.steps, config.evaluation_laps, stop, progress)
        finally:
            descent.driver.env.close()


class Descent(Rounds):
    """A training between two rounds.

    Attributes:
        driver: of the batch.
        learner: of the networks.
    """

    def __init__(self, config: DescentConfig, run: RunFolder) -> None:
        """Begin; nothing is read or written.

        Args:
            config: the configuration.
            run: folder of the training.
        """
        super().__init__(run)
        self.config, self._done = config, 0
        torch.manual_seed(config.seed)
        self.driver = Driver(
            make_batch(config.environment, config.arms, config.batch_options), config.seed, config.torque_noise
        )
        self.driver.stagger(config.episode_steps)
        blocks = self.driver.env.observation_blocks
        own = settings_of(config.environment, config.options).observation
        self.learner = Learner(config, Observations(self.driver.env), max(blocks[name].stop for name in own))

    @property
    def done(self) -> int:
        """See `Rounds`."""
        return self._done

    def next_round(self, logger: Logger) -> None:
        """See `Rounds`."""
        rows = [self.window() for _ in range(self.config.windows)]
        for name, values in zip(Figures._fields, zip(*rows, strict=True), strict=True):
            logger.record(f"descent/{name}", float(np.mean(values)))
        self._done += 1

    def window(self) -> Figures:
        """Run a window, and learn from it."""
        return self.learner.learn(self.driver.window(self.learner.wanted, self.config.horizon))

    def policy(self) -> NetworkPolicy:
        """See `Rounds`."""
        return self.learner.policy()

    def save(self, path: Path) -> None:
        """See `Rounds`."""
        state = {
            "found": self.found,
            "done": self._done,
            "driver": self.driver,
            "learner": self.learner.state(),
            "random": torch.get_rng_state(),
        }
        write_parts(path, {_STATE: pickle.dumps(state)})

    def load(self) -> None:
        """Go on from the checkpoint, which must be from a source that you trust: reading it can execute code.

        Raises:
            ValueError: if the file is not a checkpoint of such a training, or one of a version that this one cannot
                continue.
        """
        (content,) = read_parts(self.run.checkpoint, [_STATE])
        state = unpickled(self.run.checkpoint, content)
        self.driver.env.close()
        self.found, self._done, self.driver = state["found"], state["done"], state["driver"]
        self.learner.restore(state["learner"])
        torch.set_rng_state(state["random"])
