"""The study of first-order gradients: equal samples, its table, what PPO reaches by then, what a step costs."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from flexarm_agents import DescentConfig, NetworkPolicy, TeachingConfig, load_policy
from flexarm_agents.policies.load import POLICIES
from flexarm_env.laps import LAPS
from scripts.learning import gradients, measured
from tests.support.trainings import DESCENDED, recorded


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
    """PPO's trainings are those of the shipped agent's card; a torque change that was not kept has no figure."""
    config = gradients.agents()["registered"]
    one = recorded(config, {}, swing=[[0.2, 0.103]], plain=[[0.1, 0.037]])
    older = recorded(config, {}, swing=[[0.2, 0.103]], plain=[[0.1, 0.037]])
    older.trainings[0].best["plain"]["torque_change"] = None  # type: ignore[index]
    monkeypatch.setattr(gradients, "HORIZONS", (2, 4))
    slopes = {None: 0.5, NetworkPolicy: 0.25}
    monkeypatch.setattr(
        gradients, "first_action_slope", lambda horizon, policy: horizon * slopes[policy and type(policy)]
    )
    monkeypatch.setattr(gradients, "seconds_per_million", lambda config, path: {"ppo": 60.0}[path.stem])
    made = gradients.tables({"registered": one, "one": older}, tmp_path)
    lines = [[cell.strip() for cell in line.split("|")[1:-1]] for line in made["gradients"].splitlines()[2:]]
    steps = config.all_rounds * config.steps  # type: ignore[attr-defined]
    assert lines[0][2:] == ["1", f"{steps:,}", f"{120e-6 * steps:.0f}", "103.0", "2.00", "37.0", "2.00", "1.0"]
    assert lines[1][-1] == "-"
    card = json.loads((POLICIES / "square.json").read_text())
    ppo = lines[2]
    assert ppo[2:5] == [str(len(card["trainings"])), f"{card['config']['steps']:,}", "120"]
    assert ppo[5].startswith(f"{card['spread']['swing']['rms']['median'] * 1e3:.1f} / ")
    changes = [max(max(one[lap]["torque_change"]) for lap in LAPS) for one in card["trainings"]]
    assert ppo[-1].endswith(f" / {max(changes):.1f}")
    assert made["gradient_horizons"].splitlines()[2:] == ["| 2 | 1.000 | 0.500 |", "| 4 | 2.000 | 1.000 |"]


def test_derivatives_at_a_trained_network(monkeypatch: pytest.MonkeyPatch) -> None:
    """The shipped agent's network fits, and holds the arm, so that they are smaller than those of an untrained one."""
    monkeypatch.setattr(gradients, "DescentConfig", partial(DescentConfig, arms=4, episode_steps=40))
    policy = load_policy(gradients.PPO).policy
    assert isinstance(policy, NetworkPolicy)
    trained, untrained = (gradients.first_action_slope(16, one) for one in (policy, None))
    assert 0.0 < trained < 0.5 * untrained


def test_derivatives_of_an_untrained_network_grow_as_a_square(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing holds the arm, so that its tip is off by the action times half the squared time."""
    monkeypatch.setattr(gradients, "DescentConfig", partial(DescentConfig, arms=4, episode_steps=40))
    short, long = (gradients.first_action_slope(horizon, None) for horizon in (8, 16))
    assert 2.0 < long / short < 6.0
