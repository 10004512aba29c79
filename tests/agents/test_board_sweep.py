"""`flexarm evaluate --sweep`: one row along one axis."""

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
    assert "no lap lost: 0 to 1" in told


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
        *("0.500", "/", "0.500", "0.500", "/", "lost", "0.500", "/", "0.500", "0.400", "/", "0.400", "at", "3.00", "s"),
    ]
    assert found[-1] == "no lap lost: 0"
