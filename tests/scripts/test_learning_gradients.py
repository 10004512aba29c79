"""The study of first-order gradients: equal samples, its table, what PPO reaches by then, what a step costs."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from flexarm_agents import DescentConfig, NetworkPolicy, TeachingConfig
from flexarm_agents.load import POLICIES
from scripts.common.trainings import Training
from scripts.learning import gradients, measured
from tests.support.trainings import DESCENDED, row


def test_steps_of_all_candidates_count() -> None:
    agents = {name: replace(one, rounds=5) for name, one in gradients.agents().items()}
    steps = {name: gradients.all_steps(one) for name, one in agents.items()}
    assert steps["one"] == steps["state"]
    assert steps["registered"] == steps["encoders"] == steps["one"] * (5 + 2 * 4) // 5
    with pytest.raises(TypeError, match="must be a TrainingConfig or a DescentConfig"):
        gradients.all_steps(TeachingConfig())


def test_what_a_step_costs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measured, "SAMPLE", 70)
    config = DescentConfig(**DESCENDED)
    assert measured.seconds_per_million(config, tmp_path / "cost.json") > 0.0
    assert json.loads((tmp_path / "cost.json").read_text())["steps"] == 96
    with pytest.raises(TypeError, match="must be a TrainingConfig or a DescentConfig"):
        measured.seconds_per_million(object(), tmp_path / "other.json")  # type: ignore[arg-type]


def test_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Trainings by gradients are those that are found, PPO's those of the shipped agent's card."""
    config = gradients.agents()["registered"]
    found = {"registered": [Training(config, tmp_path, row(1000, 0.103, 0.037))]}
    monkeypatch.setattr(NetworkPolicy, "load", lambda path: None)
    monkeypatch.setattr(gradients, "HORIZONS", (2, 4))
    monkeypatch.setattr(gradients, "first_action_slope", lambda horizon, policy: 0.5 * horizon)
    monkeypatch.setattr(
        gradients, "seconds_per_million", lambda config, path: {"registered": 30.0, "ppo": 60.0}[path.stem]
    )
    made = gradients.tables(found, tmp_path)
    one, ppo = ([cell.strip() for cell in line.split("|")[1:-1]] for line in made["gradients"].splitlines()[2:])
    steps = config.all_rounds * config.steps  # type: ignore[attr-defined]
    assert one[2:] == ["1", f"{steps:,}", f"{30e-6 * steps:.0f}", "0.1030", "2.00", "0.0370", "2.00"]
    card = json.loads((POLICIES / "square.json").read_text())
    assert ppo[2:5] == [str(len(card["trainings"])), f"{card['config']['steps']:,}", "120"]
    assert ppo[5].startswith(f"{card['spread']['swing']['rms']['median']:.4f} / ")
    assert made["gradient_horizons"].splitlines()[2:] == ["| 2 | 1.000 | 1.000 |", "| 4 | 2.000 | 2.000 |"]


def test_derivatives_of_an_untrained_network_grow_as_a_square(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing holds the arm, so that its tip is off by the action times half the squared time."""
    monkeypatch.setattr(gradients, "DescentConfig", partial(DescentConfig, arms=4, episode_steps=40))
    short, long = (gradients.first_action_slope(horizon, None) for horizon in (8, 16))
    assert 2.0 < long / short < 6.0
