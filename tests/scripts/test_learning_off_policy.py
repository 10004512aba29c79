"""The study of algorithms with a replay buffer: their settings, their updates, its table and picture."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot as plt

from flexarm_agents import TrainingConfig
from scripts.common.curves import FOLDER
from scripts.common.markdown import shown_blocks
from scripts.learning import measured, off_policy
from scripts.learning.records import read
from tests.support.trainings import TINIES, recorded


def test_settings_are_the_tuned_ones() -> None:
    """So that what the page shows is what `flexarm train --algorithm` does."""
    for environment, algorithms in off_policy.PAIRS.items():
        for algorithm in algorithms:
            config = off_policy.config_of(environment, algorithm)
            usual = TrainingConfig(environment=environment, algorithm=algorithm)  # type: ignore[arg-type]
            free = {"evaluate_every", "steps"} if config.rollout else {"evaluate_every"}
            assert set(config.differences(usual)) <= free


def test_updates_are_counted() -> None:
    assert off_policy.updates(TrainingConfig(**TINIES["lags"])) == 512 * 2 // 64
    config = TrainingConfig(**TINIES["sac"])
    assert off_policy.updates(config) == (512 - 60) // 16


@pytest.mark.parametrize("name", ["sac", "lags"])
def test_what_learning_costs(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of SAC, the steps that are timed have updates."""
    monkeypatch.setattr(measured, "SAMPLE", 256)
    monkeypatch.setattr(measured, "UPDATES", 10)
    config = TrainingConfig(**TINIES[name])
    assert measured.seconds_per_million(config, tmp_path / "cost.json") > 0.0
    steps = json.loads((tmp_path / "cost.json").read_text())["steps"]
    assert steps == (256 if config.updates is None else 10 * config.envs * 4)


def test_what_another_configuration_cost_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A kept figure is taken over for the configuration that was measured alone."""
    measuring = iter([(2.0, 1000), (3.0, 1000)])
    monkeypatch.setattr(measured, "_sample", lambda config: next(measuring))
    config, path = TrainingConfig(**TINIES["sac"]), tmp_path / "cost.json"
    assert [measured.seconds_per_million(config, path) for _ in range(2)] == [2000.0, 2000.0]
    assert measured.seconds_per_million(replace(config, gamma=0.9), path) == 3000.0


def test_table_and_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two algorithms on one environment; an evaluation with a lost lap is a gap in the curve."""
    agents = {}
    for algorithm in ("ppo", "sac"):
        config = off_policy.config_of("SquareResidual-v0", algorithm)
        laps = {"swing": [[None, 0.3], [None, 0.4]], "plain": [[0.5, 0.2], [0.5, 0.2]]}
        agents[f"SquareResidual-v0-{algorithm}"] = recorded(config, {}, {}, **laps)
    drawn = []
    monkeypatch.setattr(plt, "close", drawn.append)
    lines = off_policy.tables(agents, tmp_path)["off_policy"].splitlines()
    monkeypatch.undo()
    assert len(lines) == 4
    cells = [cell.strip() for cell in lines[2].split("|")[1:-1]]
    assert cells[:4] == ["`SquareResidual-v0`", "PPO", "2", "500,000"]
    assert cells[5:] == ["1.0", "350 / 350 / 400", "200 / 200 / 200"]
    steps, seconds = drawn[0].axes
    for axis in (steps, seconds):
        assert len(axis.lines) == 2
        assert np.isnan(axis.lines[0].get_ydata()[0])
        assert axis.lines[0].get_ydata()[1] == pytest.approx(275.0)  # [mm]
    np.testing.assert_allclose(seconds.lines[0].get_xdata(), [0.12, 0.24])
    plt.close(drawn[0])
    assert (tmp_path / off_policy.PICTURE).stat().st_size > 10_000


def test_the_page_has_what_the_data_say(tmp_path: Path) -> None:
    known = read(off_policy.STUDY, FOLDER / "off_policy.json")
    assert off_policy.tables(known, tmp_path)["off_policy"] == shown_blocks()["off_policy"]
