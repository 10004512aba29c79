"""`FOPGTraining`: first-order policy gradients on a batch of arms."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import torch

from flexarm_agents.descent.config import FOPGConfig
from flexarm_agents.descent.learner import Figures, Learner
from flexarm_agents.descent.observations import Observations, check_differentiable
from flexarm_agents.descent.window import Driver
from flexarm_agents.environments import make_batch, settings_of
from flexarm_agents.evaluation.scoring import StandardScore, rank
from flexarm_agents.policies.network import NetworkPolicy
from flexarm_agents.training.loop import Rounds
from flexarm_agents.training.run_folder import RunFolder
from flexarm_agents.training.warm_start import check_curriculum


class Candidate(NamedTuple):
    """A policy after its trial."""

    rank: tuple[int, float]  # of its last evaluation, smaller is better
    driver: Driver  # of its batch
    learner: Learner  # of its networks


class FOPGTraining(Rounds):
    """A training with several untrained policies at the beginning, of which the best one goes on."""

    config: FOPGConfig
    driver: Driver
    learner: Learner
    leading: Candidate | None = None  # the best whose trial is over; None before the first, and after the last
    done: int = 0

    def __init__(self, config: FOPGConfig, run: RunFolder) -> None:
        """Check the curriculum, and that derivatives run through all options; see `Training`."""
        super().__init__(config, run)
        self.round_steps = config.steps
        check_curriculum(config)
        check_differentiable(settings_of(config.environment, config.options | config.curriculum_options))

    def start(self) -> None:
        """See `Training`."""
        torch.manual_seed(self.config.seed)
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
        blocks = driver.env.observation_blocks
        own = settings_of(self.config.environment, self.config.options).observation
        return Learner(self.config, Observations(driver.env), max(blocks[name].stop for name in own))

    def next_round(self) -> None:
        """See `Rounds`."""
        trial, candidates = self.config.trial_rounds, self.config.candidates
        if candidates > 1 and 0 < self.done <= candidates * trial and self.done % trial == 0:
            self._end_trial(last=self.done == candidates * trial)
        rows = [self.window() for _ in range(self.config.windows)]
        for name, values in zip(Figures._fields, zip(*rows, strict=True), strict=True):
            self.logger.record(f"fopg/{name}", float(np.mean(values)))
        self.done += 1

    def _end_trial(self, last: bool) -> None:
        """Remember the policy if it is the best candidate so far; go on with the next one, after the last the best."""
        judged = StandardScore.of(self.progress.rows[-1])
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
        return self.learner.learn(self.driver.window(self.learner.outputs, self.config.horizon))

    def policy(self) -> NetworkPolicy:
        """See `Rounds`."""
        return self.learner.policy()

    def state(self, complete: bool) -> dict[str, Any]:
        """See `Training`."""
        leading = self.leading
        return {
            "done": self.done,
            "present": (self.driver, self.learner.state()),
            "leading": None if leading is None else (leading.rank, (leading.driver, leading.learner.state())),
        }

    def restore(self, state: dict[str, Any]) -> None:
        """See `Training`."""
        leading = state["leading"]
        self.done = state["done"]
        self.driver, self.learner = self._restored(*state["present"])
        self.leading = None if leading is None else Candidate(leading[0], *self._restored(*leading[1]))

    def _restored(self, driver: Driver, learned: dict[str, Any]) -> tuple[Driver, Learner]:
        learner = self._untrained(driver)
        learner.restore(learned)
        return driver, learner

    def close(self) -> None:
        """See `Training`."""
        if hasattr(self, "driver"):  # else it was not started
            self.driver.env.close()
        if self.leading is not None:
            self.leading.driver.env.close()
