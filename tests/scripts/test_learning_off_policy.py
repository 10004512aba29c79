"""The study of algorithms with a replay buffer: their settings, their updates, its table and picture."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib import pyplot as plt

from flexarm_agents import TrainingConfig
from flexarm_agents.run_folder import RunFolder
from scripts.common.trainings import Training
from scripts.learning import measured, off_policy
from tests.support.trainings import TINIES, row


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


def test_table_and_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two algorithms on one environment; an evaluation with a lost lap is a gap in the curve."""
    found = {}
    for algorithm in ("ppo", "sac"):
        config = off_policy.config_of("SquareResidual-v0", algorithm)
        trainings = []
        for seed in range(2):
            folder = tmp_path / algorithm / f"seed-{seed}"
            folder.mkdir(parents=True)
            rows = [row(1000, None, 0.5), row(2000, 0.3 + 0.1 * seed, 0.2)]
            RunFolder(folder).evaluations.with_suffix(".json").write_text(json.dumps(rows))
            trainings.append(Training(replace(config, seed=seed), folder, rows[1]))
        found[f"SquareResidual-v0-{algorithm}"] = trainings
    drawn = []
    monkeypatch.setattr(off_policy, "seconds_per_million", lambda config, path: 120.0)
    monkeypatch.setattr(plt, "close", drawn.append)
    lines = off_policy.tables(found, tmp_path)["off_policy"].splitlines()
    monkeypatch.undo()
    assert len(lines) == 4
    cells = [cell.strip() for cell in lines[2].split("|")[1:-1]]
    assert cells[:4] == ["`SquareResidual-v0`", "PPO", "2", "500,000"]
    assert cells[5:] == ["1.0", "0.350 / 0.350 / 0.400", "0.200 / 0.200 / 0.200"]
    steps, seconds = drawn[0].axes
    for axis in (steps, seconds):
        assert len(axis.lines) == 2
        assert np.isnan(axis.lines[0].get_ydata()[0])
        assert axis.lines[0].get_ydata()[1] == pytest.approx(0.275)
    np.testing.assert_allclose(seconds.lines[0].get_xdata(), [0.12, 0.24])
    plt.close(drawn[0])
    assert (tmp_path / off_policy.PICTURE).stat().st_size > 10_000
