"""The study of first-order gradients: equal samples, its table, what PPO reaches by then, what a step costs."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from flexarm_agents import DescentConfig
from flexarm_agents.run_folder import RunFolder
from scripts.common.trainings import Training
from scripts.learning import gradients, measured
from tests.scripts.test_learning_off_policy import row
from tests.support.trainings import DESCENDED


def test_all_ways_have_as_many_steps() -> None:
    steps = {one.rounds * one.steps for one in gradients.agents().values() if isinstance(one, DescentConfig)}
    assert len(steps) == 1
    (each,) = steps
    assert each == pytest.approx(gradients.agents()["ppo"].steps, rel=0.05)  # type: ignore[attr-defined]


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
    paid = {"registered": 30.0, "ppo": 60.0}
    monkeypatch.setattr(gradients, "seconds_per_million", lambda config, path: paid[path.stem])
    lines = gradients.tables(found, tmp_path)["gradients"].splitlines()
    rows_of = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines[2:]]
    assert [cells[0] for cells in rows_of] == ["first-order gradients", "PPO, as many steps", "PPO, as many seconds"]
    assert [cells[3:5] for cells in rows_of] == [["1,966,080", "59"], ["1,966,080", "118"], ["983,040", "59"]]
    assert rows_of[0][5:] == ["0.1030", "2.00", "0.0370", "2.00"]
    assert rows_of[2][5::2] == ["0.3000", "0.2000"]
