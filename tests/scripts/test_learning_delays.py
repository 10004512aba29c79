"""The study of delays: what its agents differ in, what is kept of their laps, and its table."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot as plt

from flexarm_agents import TrainingConfig
from flexarm_agents.board.columns import Point
from flexarm_agents.board.rows import Row
from flexarm_env.laps import LAPS
from scripts.common import cells
from scripts.common.trainings import Training
from scripts.learning import delays, measured
from tests.support.trainings import TINY

POINTS = [Point(0.0, {"delay": 0.0}), Point(50.0, {"delay": 0.05})]


def test_remedies_differ_in_nothing_else() -> None:
    """Environment, steps, seeds and evaluations are those of the agent without a remedy."""
    own = {"algorithm", "lags", "observer", "options", "envs", "rollout", "learning_rate", "hidden", "lstm"}
    own |= {"critic_lstm", "lesson_options", "epochs", "batch"}
    for trained in delays.TRAINED:
        without = delays.config_of(trained, "none")
        for remedy in delays.REMEDIES:
            assert set(delays.config_of(trained, remedy).differences(without)) <= own
        changed = delays.config_of(trained, "stacked").differences(without)
        assert changed == ["lags"]
        assert delays.config_of(trained, "actions").differences(without) == ["options"]
    assert len(delays.agents()) == len(delays.TRAINED) * len(delays.REMEDIES)
    assert set(delays.SHOWN) <= set(delays.DELAYS)


def test_laps_are_run_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Cells are kept; a lost lap has no error."""
    asked: list[float] = []

    def compute(job: Any) -> list[dict[str, Any]]:
        asked.extend(point.value for point in job.points)
        results = []
        for point in job.points:
            figures = {"swing": {"rms": 0.1 + point.value}, "plain": None if point.value else {"rms": 0.3}}
            results.append({"episodes": [{"lap": lap, "figures": one} for lap, one in figures.items()]})
        return results

    monkeypatch.setattr(cells, "compute", compute)
    for _ in range(2):
        found = measured.errors_at(Row("student"), POINTS, tmp_path)
        assert found == {"swing": [0.1, 50.1], "plain": [0.3, None]}
    assert asked == [0.0, 50.0]
    assert [measured.mean_of_laps(found, n) for n in range(2)] == [pytest.approx(0.2), None]
    monkeypatch.setattr(cells, "compute", lambda job: [{"not_applicable": "why"} for _ in job.points])
    with pytest.raises(ValueError, match=r"row student at 0.0: why"):
        measured.errors_at(Row("student"), POINTS, tmp_path / "other")


def test_what_learning_costs_is_measured_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(measured, "SAMPLE", 256)
    seconds = measured.seconds_per_million(TrainingConfig(**TINY), tmp_path / "cost.json")
    assert seconds > 0.0
    monkeypatch.setattr(measured, "new_model", None)
    assert measured.seconds_per_million(TrainingConfig(**TINY), tmp_path / "cost.json") == seconds


def test_the_table_and_the_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two seeds each, one of which loses the plain lap at the largest delay."""

    def errors(row: Row, points: Any, folder: Path) -> measured.Errors:
        lost = None if row.source.endswith("seed-1") else 0.5
        values = [0.1 + 0.01 * n for n in range(len(points) - 1)]
        return {"swing": [*values, 0.5], "plain": [*values, lost]}

    drawn: list[Any] = []
    monkeypatch.setattr(delays, "errors_at", errors)
    monkeypatch.setattr(delays, "seconds_per_million", lambda config, path: 40.0)
    monkeypatch.setattr(plt, "close", drawn.append)
    found = {
        name: [Training(replace(config, seed=seed), tmp_path / name / f"seed-{seed}", {}) for seed in range(2)]
        for name, config in delays.agents().items()
    }
    monkeypatch.setattr(delays, "Row", FakeRow)
    lines = delays.tables(found, tmp_path)["delay_remedies"].splitlines()
    monkeypatch.undo()
    assert len(lines) == 2 + 2 * (len(delays.REMEDIES) + 2)
    assert lines[0].count("|") == lines[2].count("|")
    taught, own = lines[3], lines[4]
    assert [cell.strip() for cell in taught.split("|")[1:6]] == [
        "31 ms",
        delays.YARDSTICKS["known"]["student"],
        "1",
        "-",
        "-",
    ]
    cells = [cell.strip() for cell in own.split("|")[1:-1]]
    assert cells[:5] == ["31 ms", "none", "2", "1,000,000", "40"]
    assert cells[5] == "0.100 / 0.100 / 0.100"
    assert cells[-1] == "lost / lost / lost"
    for axis in drawn[0].axes:
        assert len(axis.lines) == len(delays.REMEDIES) + 2
        assert np.isnan(axis.lines[-1].get_ydata()[-1]) == axis.get_title().startswith("plain")
    plt.close(drawn[0])
    assert (tmp_path / delays.PICTURE).stat().st_size > 10_000
    assert len(drawn[0].axes) == len(LAPS) * len(delays.TRAINED)


def test_what_was_measured_before_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where an agent's trainings are not there, and its configuration is the one of then."""
    monkeypatch.setattr(delays, "FOLDER", tmp_path)
    monkeypatch.setattr(delays, "Row", FakeRow)
    points = len(delays.POINTS)
    monkeypatch.setattr(delays, "errors_at", lambda *given: {"swing": [1.0 / 7.0] * points, "plain": [None] * points})
    monkeypatch.setattr(delays, "seconds_per_million", lambda config, path: 40.0)
    assert delays.kept() == {}
    folder = tmp_path / "known-stacked" / "seed-0"
    found = {"known-stacked": [Training(delays.agents()["known-stacked"], folder, {})]}
    first = delays.tables(found, tmp_path)
    known = delays.kept()
    assert set(known) == set(found)
    assert known["known-stacked"]["errors"] == [{"swing": [0.142857] * points, "plain": [None] * points}]
    assert delays.tables({}, tmp_path) == first
    known["known-stacked"]["config"]["gamma"] = 0.9
    (tmp_path / delays.DATA).write_text(json.dumps(known))
    assert [line.agent for line in delays.lines({}, tmp_path) if line.agent] == []


class FakeRow:
    def __init__(self, source: str, name: str = "") -> None:
        self.source = source
