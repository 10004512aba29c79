"""Trainings that tests of several modules look at, and what keeps tiny trainings tiny."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from flexarm_agents import config_of, train
from tests.support.trainings import TAUGHT, short_rollouts, without_pictures


@pytest.fixture(scope="module", autouse=True)
def no_pictures() -> Iterator[None]:
    """Let trainings draw in a folder `ppo` alone; see `without_pictures`."""
    with without_pictures():
        yield


@pytest.fixture(scope="session")
def taught(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run the tiny teaching once, undisturbed; its folder must not be changed."""
    folder = tmp_path_factory.mktemp("runs") / "dagger"
    with without_pictures(), short_rollouts():
        train(config_of(**TAUGHT), folder)
    return folder
