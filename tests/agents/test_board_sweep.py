"""`flexarm evaluate --sweep`: one row along one axis."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from flexarm_agents.board.columns import Column
from flexarm_agents.board.summary import point_summary
from flexarm_agents.commands import evaluate, sweep
from tests.support.boards import points


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
    assert "plain lap: never lost; never error doubled" in told


VALUES = [0.0, 5.0, 30.0, 35.0, 60.0]


@pytest.mark.parametrize(
    ("low", "high", "complete", "said"),
    [
        (5.0, 60.0, None, "never lost; error doubled at 5 and below, 60 and above"),
        (None, 60.0, None, "never lost; error doubled at 60 and above"),
        (None, None, None, "never lost; never error doubled"),
        (None, None, [], "lost everywhere"),
        (None, None, [0.0, 5.0, 60.0], "lost at the nominal value; complete at 0 to 5, 60"),
    ],
)
def test_where_an_axis_fails_is_told(
    low: float | None, high: float | None, complete: list[float] | None, said: str
) -> None:
    ends = {"doubled": {"low": low, "high": high}, "lost": {"low": None, "high": None}, "complete": complete}
    assert sweep.fails(ends, VALUES) == said


def test_lost_laps_come_first_and_count() -> None:
    column = Column("Sensor noise", "mm", tuple(points([0.0, 1.0])), 0.0)
    complete = {"lap": "plain", "duration": 16.0, "figures": {"rms": 0.5, "rms_after_2s": 0.4, "maximum": 1.0}}
    lost = {"lap": "plain", "duration": 3.0, "figures": None}
    swing = [one | {"lap": "swing"} for one in (complete, complete)]
    episodes = [{"episodes": [*swing, complete, one]} for one in (complete, lost)]
    found = sweep._table("mine", column, [point_summary(one) for one in episodes]).splitlines()
    (line,) = [one for one in found if one.startswith("1 ")]
    assert line.split() == [
        *("1", "0", "of", "2", "/", "1", "of", "2"),
        *("0.500", "1.500", "0.500", "/", "0.500", "0.400", "/", "0.400", "at", "3.00", "s"),
    ]
    assert found[-1] == "plain lap: lost at 1 and above; never error doubled"
