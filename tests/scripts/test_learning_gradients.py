"""The study of first-order gradients: equal samples, its table, what PPO reaches by then, what a step costs."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from flexarm_agents import DescentConfig, NetworkPolicy
from flexarm_agents.run_folder import RunFolder
from scripts.common.trainings import Training
from scripts.learning import gradients, measured
from tests.scripts.test_learning_off_policy import row
from tests.support.trainings import DESCENDED


def test_all_ways_but_one_have_as_many_steps() -> None:
    agents = gradients.agents()
    steps = {name: gradients.all_steps(one) for name, one in agents.items() if isinstance(one, DescentConfig)}
    assert steps.pop("encoders_longer") == 2 * steps["encoders"]
    (each,) = set(steps.values())
    assert each == pytest.approx(agents["ppo"].steps, rel=0.05)  # type: ignore[attr-defined]


def test_what_a_step_costs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measured, "SAMPLE", 70)
    config = DescentConfig(**DESCENDED)
    assert measured.seconds_per_million(config, tmp_path / "cost.json") > 0.0
    assert json.loads((tmp_path / "cost.json").read_text())["steps"] == 96
    with pytest.raises(TypeError, match="must be a TrainingConfig or a DescentConfig"):
        measured.seconds_per_million(object(), tmp_path / "other.json")  # type: ignore[arg-type]


def test_ppo_is_shown_after_as_many_steps_and_seconds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An evaluation with a lost lap is not the best one, and one that came later does not count."""
    found = {}
    for name in ("registered", "ppo"):
        config = gradients.agents()[name]
        folder = tmp_path / name / "seed-0"
        folder.mkdir(parents=True)
        rows = [row(1000, None, 0.01), row(900_000, 0.3, 0.2), row(1_500_000, 0.103, 0.037), row(3_000_000, 0.01, 0.01)]
        RunFolder(folder).evaluations.with_suffix(".json").write_text(json.dumps(rows))
        found[name] = [Training(replace(config, seed=0), folder, rows[2])]
    monkeypatch.setattr(NetworkPolicy, "load", lambda path: None)
    monkeypatch.setattr(gradients, "HORIZONS", (2, 4))
    monkeypatch.setattr(gradients, "first_action_slope", lambda horizon, policy: 0.5 * horizon)
    paid = {"registered": 30.0, "ppo": 60.0}
    monkeypatch.setattr(gradients, "seconds_per_million", lambda config, path: paid[path.stem])
    made = gradients.tables(found, tmp_path)
    lines = made["gradients"].splitlines()
    rows_of = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines[2:]]
    assert [cells[0] for cells in rows_of] == ["first-order gradients", "PPO, as many steps", "PPO, as many seconds"]
    assert [cells[3:5] for cells in rows_of] == [["1,966,080", "59"], ["1,966,080", "118"], ["983,040", "59"]]
    assert rows_of[0][5:] == ["0.1030", "2.00", "0.0370", "2.00"]
    assert rows_of[2][5::2] == ["0.3000", "0.2000"]
    assert made["gradient_horizons"].splitlines()[2:] == ["| 2 | 1.000 | 1.000 |", "| 4 | 2.000 | 2.000 |"]


def test_derivatives_of_an_untrained_network_grow_as_a_square(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing holds the arm, so that its tip is off by the action times half the squared time."""
    monkeypatch.setattr(gradients, "DescentConfig", partial(DescentConfig, arms=4, episode_steps=40))
    short, long = (gradients.first_action_slope(horizon, None) for horizon in (8, 16))
    assert 2.0 < long / short < 6.0
