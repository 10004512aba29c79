"""`flexarm leaderboard`: measures what it is asked for, and leaves out what cannot be measured here."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from flexarm_agents.board import measure as measuring
from flexarm_agents.board.columns import COLUMNS, measurable
from flexarm_agents.commands import leaderboard as verb
from tests.scripts.test_leaderboard import ROWS, TINY, Here


@pytest.mark.usefixtures("uncompiled")
def test_the_verb_measures_what_it_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(measuring, "all_entries", lambda added: ROWS)
    monkeypatch.setattr(measuring, "COLUMNS", TINY)
    monkeypatch.setattr(verb, "executor", lambda *arguments: Here())
    verb.run(["--entries", "agent", "--columns", "payload", "--output", str(tmp_path)])
    assert capsys.readouterr().out.endswith("1 of 1 entries; tables beside it\n")
    board = json.loads((tmp_path / measuring.DATA).read_text())
    assert [row["name"] for row in board["rows"]] == ["agent"]
    monkeypatch.setattr(verb, "executor", lambda *arguments: Here(0))
    with pytest.raises(OSError, match="1 failed, see above; their entries lack cells"):
        verb.run(["--entries", "again", "--columns", "payload", "--output", str(tmp_path / "other")])
    assert "again: OSError: killed" in capsys.readouterr().err


def test_added_rows_are_wanted_beside_those_that_are_named() -> None:
    rows = measuring.chosen_entries(["ifdc"], (), ["tests.support.boards:Nobody"])
    assert [row.name for row in rows] == ["ifdc", "tests.support.boards:Nobody"]
    assert [row.name for row in measuring.chosen_entries(["ifdc", "lqg"], ["lqg"])] == ["ifdc"]


def test_the_chain_is_left_out_where_its_engine_is_absent(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first example of the verb's help ended in an error on the base install."""
    columns = {name: COLUMNS[name] for name in ("nominal", "delay")}
    assert measurable(columns) == (columns, "")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    found, told = measurable(columns)
    assert [point.value for point in found["nominal"].points] == ["square", "track", "reach"]
    assert found["delay"] == columns["delay"]
    assert told.startswith("nominal: without the chain, for which mujoco is not installed; run ")
    monkeypatch.setattr(verb, "executor", lambda *arguments: Here(0))
    with pytest.raises(OSError, match="failed"):
        verb.run(["--entries", "joint_pd", "--columns", "nominal", "--output", str(tmp_path)])
    assert told in capsys.readouterr().err
