"""`flexarm evaluate --sweep`: one row along one axis."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from flexarm_agents.board.columns import Column
from flexarm_agents.commands import evaluate, sweep
from tests.support.boards import points
from tests.support.refusals import refuses


@pytest.mark.usefixtures("uncompiled")
def test_evaluate_sweeps_an_axis(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    tiny = {"noise": Column("Sensor noise", "mm", tuple(points([0.0, 1.0])), 0.0)}
    monkeypatch.setattr(sweep, "COLUMNS", tiny)
    output = tmp_path / "swept.json"
    evaluate.run(["--policy", "square", "--sweep", "noise", "--output", str(output)])
    told = capsys.readouterr().out
    (results,) = [one["results"] for one in json.loads(output.read_text())["rows"]]
    for point in results:
        for one in point["episodes"]:
            assert f"{one['figures']['rms']:.3f}" in told
    assert "plain lap: never error doubled; never lost" in told
    with refuses(ValueError, "sweep = 'noises'", "noise"):
        evaluate.run(["--policy", "square", "--sweep", "noises"])
    with refuses(ValueError, "nothing to sweep"):
        evaluate.run(["--sweep", "noise"])
    with refuses(ValueError, "the board sets them"):
        evaluate.run(["--policy", "square", "--sweep", "noise", "--laps", "3"])


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (5.0, 60.0, "error doubled at 5 and below, 60 and above"),
        (None, 60.0, "error doubled at 60 and above"),
        (None, None, "never error doubled"),
    ],
)
def test_both_ends_of_what_fails_are_told(low: float | None, high: float | None, said: str) -> None:
    ends = {"doubled": {"low": low, "high": high}, "lost": {"low": None, "high": None}}
    assert sweep.fails(ends) == f"{said}; never lost"
