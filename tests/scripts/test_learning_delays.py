"""The study of delays: what its agents differ in, what is kept of their laps, and its table."""

from __future__ import annotations

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
from tests.support.trainings import TINY, recorded

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


def test_a_training_is_measured(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """At all delays, under the name of its agent."""

    def errors(row: Row, points: Any, folder: Path) -> measured.Errors:
        assert (row.name, points, folder) == ("known-stacked", delays.POINTS, tmp_path / "cells")
        return {"swing": [0.1], "plain": [None]}

    monkeypatch.setattr(measured, "errors_at", errors)
    monkeypatch.setattr(measured, "Row", FakeRow)
    training = Training(delays.config_of("known", "stacked"), tmp_path / "known-stacked" / "seed-0", {})
    assert delays.STUDY.measure(training, tmp_path) == {"errors": {"swing": [0.1], "plain": [None]}}


def test_the_table_and_the_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of two seeds each, one of which loses the plain lap at the largest delay."""
    values = [0.1 + 0.01 * n for n in range(len(delays.POINTS) - 1)]
    several = [{"errors": {"swing": [*values, 0.5], "plain": [*values, last]}} for last in (0.5, None)]
    drawn: list[Any] = []
    monkeypatch.setattr(delays, "errors_at", lambda *given: several[0]["errors"])
    monkeypatch.setattr(plt, "close", drawn.append)
    agents = {name: recorded(config, *several) for name, config in delays.agents().items()}
    lines = delays.tables(agents, tmp_path)["delay_remedies"].splitlines()
    without = delays.tables({"known-none": agents["known-none"]}, tmp_path)["delay_remedies"].splitlines()
    monkeypatch.undo()
    assert len(lines) == 2 + 2 * (len(delays.REMEDIES) + 2)
    assert len(without) == 2 + 1 + 2 * 2
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
    assert cells[:5] == ["31 ms", "none", "2", "1,000,000", "120"]
    assert cells[5] == "100 / 100 / 100"
    assert cells[-1] == "lost / lost / lost"
    for axis in drawn[0].axes:
        assert len(axis.lines) == len(delays.REMEDIES) + 2
        assert np.isnan(axis.lines[-1].get_ydata()[-1]) == axis.get_title(loc="left").startswith("plain")
    for figure in drawn:
        plt.close(figure)
    assert (tmp_path / delays.PICTURE).stat().st_size > 10_000
    assert len(drawn[0].axes) == len(LAPS) * len(delays.TRAINED)


class FakeRow:
    def __init__(self, source: str, name: str = "") -> None:
        self.source, self.name = source, name
