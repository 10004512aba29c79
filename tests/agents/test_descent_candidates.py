"""A descent begins with several policies; the best one goes on."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from stable_baselines3.common.logger import Logger

from flexarm_agents import FOPGConfig
from flexarm_agents.descent.training import FOPGTraining
from flexarm_agents.descent.window import Window
from flexarm_agents.training.run_folder import RunFolder
from tests.support.trainings import DESCENDED, row


@pytest.mark.parametrize(
    ("errors", "best"),
    [([0.3, 0.1, 0.2], 1), ([0.1, 0.1, 0.2], 0), ([None, 0.4, 0.3], 2), ([0.4, None, None], 0)],
)
def test_the_best_candidate_goes_on(errors: list[float | None], best: int, tmp_path: Path) -> None:
    """By the evaluation after its trial; it goes on where it was, in its own episodes."""
    training = FOPGTraining(FOPGConfig(**DESCENDED), RunFolder(tmp_path))
    training.logger = Logger(folder=None, output_formats=[])
    training.start()
    learners, drivers = [], []
    for error in errors:
        training.next_round()
        training.progress.rows.append(row(64, error, 0.05))
        learners.append(training.learner)
        drivers.append(training.driver)
    assert len(set(map(id, learners))) == len(errors)
    training.next_round()
    assert training.learner is learners[best]
    assert training.driver is drivers[best]
    training.close()


def test_candidates_differ_and_meet_the_same_episodes(tmp_path: Path) -> None:
    training = FOPGTraining(FOPGConfig(**DESCENDED), RunFolder(tmp_path))
    training.start()

    def at_rest() -> Window:
        return training.driver.window(lambda seen: np.zeros((len(seen), 2)), 3)

    policy, window = training.policy(), at_rest()
    training.progress.rows.append(row(64, 0.1, 0.1))
    training._end_trial(last=False)
    assert not np.array_equal(policy.weights[0], training.policy().weights[0])
    assert np.array_equal(window.states, at_rest().states)
    training.close()
