"""The study of exploration: what its agents differ in, figures of the swing lap's start, and its tables."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from flexarm_agents import TrainingConfig, load_policy
from flexarm_agents.environments import make_one
from flexarm_agents.training.run_folder import RunFolder
from flexarm_env.laps import LAPS
from flexarm_env.metrics import elbow_changes
from scripts.common.trainings import Training
from scripts.learning import exploration
from scripts.learning.exploration import Driver, Noisy, config_of, start_of
from tests.support.trainings import recorded

SHIPPED = load_policy("square").policy


@pytest.fixture(scope="module")
def driver() -> Iterator[Driver]:
    env = make_one(exploration.SQUARE)
    yield Driver(env, SHIPPED)
    env.close()


def test_ways_differ_in_what_they_say() -> None:
    """All are judged on the registered environment with the same observation, after as many steps."""
    usual = config_of("mix")
    assert set(usual.differences(TrainingConfig())) == {"steps", "evaluate_every", "lesson_options"}
    for name, way in exploration.WAYS.items():
        assert set(config_of(name).differences(usual)) <= set(way.settings)
    assert exploration.STUDY.agents.keys() == exploration.WAYS.keys()


def test_figures_of_the_start(driver: Driver) -> None:
    """They are those of the lap's score, split at 2 s."""
    run = driver.laps()["swing"]
    found = start_of(run)
    errors = np.hypot(*(run.tip - run.reference).T)  # type: ignore[misc,operator]
    assert found.rms == pytest.approx(np.sqrt(np.mean(errors**2)))
    assert found.first == pytest.approx(np.sqrt(np.mean(errors[:201] ** 2)))
    assert found.later == pytest.approx(np.sqrt(np.mean(errors[201:] ** 2)))
    assert found.passed == elbow_changes(run)[0] < 2.0
    assert start_of(driver.laps()["plain"]).passed is None


def test_noise_costs_reward(driver: Driver, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(exploration, "EPISODES", 2)
    exact, noisy = (driver.noisy_reward(deviation, "plain") for deviation in (0.0, 0.3))
    rewards = driver.laps()["plain"].reward
    assert rewards is not None
    assert exact == pytest.approx(rewards[1:201].sum())
    assert noisy < exact - 10.0
    observation, _ = driver.env.reset(seed=0)
    first, again, other = (Noisy(SHIPPED, 0.1, seed).predict(observation)[0] for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)
    np.testing.assert_array_equal(
        Noisy(SHIPPED, 0.0, 1).predict(observation)[0], driver.policy.predict(observation, deterministic=True)[0]
    )


def test_what_is_measured_of_laps(driver: Driver, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a training: the laps of its best policy, as plain data."""
    monkeypatch.setattr(exploration, "EPISODES", 1)
    folder = tmp_path / "mix" / "seed-0"
    folder.mkdir(parents=True)
    SHIPPED.save(RunFolder(folder).best)
    found = exploration.measure(Training(config_of("mix"), folder, {}), tmp_path)
    assert json.loads(json.dumps(found)) == found
    laps = driver.laps()
    for lap, run in laps.items():
        one, start = found[lap], start_of(run)
        assert {name: one[name] for name in start._fields} == start._asdict()
        assert run.reward is not None
        assert one["reward"] == pytest.approx(run.reward[1:].sum())
        assert one["discounted"] == pytest.approx(sum(0.985**n * own for n, own in enumerate(run.reward[1:])))
        assert one["noisy"][0] > one["noisy"][2]
    swing = found["swing"]
    assert len(swing["distances"]) == len(swing["deflections"]) == 101
    assert swing["distances"][50] == pytest.approx(exploration.distances(laps["swing"])[100], abs=5e-5)
    assert "distances" not in found["plain"]


def test_tables_and_picture(driver: Driver, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two seeds of one way, one of which does not swing; nothing is known of the others."""
    monkeypatch.setattr(Driver, "noisy_reward", lambda self, deviation, lap: 100.0 - deviation)
    laps = exploration.laps_of(driver)
    other = {**laps, "swing": {**laps["swing"], "rms": 0.3, "passed": None}}
    monkeypatch.setattr(exploration, "laps_of", lambda driver: laps)
    several = {"mix": recorded(config_of("mix"), laps, other, swing=[[0.5, 0.2], [0.5, 0.3]])}
    made = exploration.tables(several, tmp_path)
    assert set(made) == set(exploration.STUDY.names)
    lines = made["exploration"].splitlines()
    assert len(lines) == 2 + 3
    cells = [cell.strip() for cell in lines[-1].split("|")[1:-1]]
    assert cells[:3] == [exploration.WAYS["mix"].text, "2", "1"]
    assert [len(cell.split(" / ")) for cell in cells[3:]] == [3, 3, 3, 1, 1, 3, 3]
    assert cells[3].endswith(" / 300")
    assert cells[7] == "-"
    assert cells[8] == "250 / 250 / 300"
    assert len(made["exploration_rewards"].splitlines()) == 2 + 3 * len(LAPS)
    assert made["exploration_rewards"].splitlines()[-1].endswith("| 100.0 | 99.9 | 99.7 |")
    assert (tmp_path / exploration.PICTURE).stat().st_size > 10_000
    assert set(exploration.tables({}, tmp_path)) == {"exploration"}
