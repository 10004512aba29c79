"""`Progress`: a line of the terminal, once it takes long, or lines of a log."""

from __future__ import annotations

import pytest

from flexarm_agents.commands import progress
from flexarm_agents.commands.progress import Progress


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_a_line_is_shown_after_a_second_and_taken_away(
    clock: list[float], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    with Progress(8, "cells") as tick:
        clock[0] = 0.9
        tick()
        assert capsys.readouterr().err == ""
        clock[0] = 2.0
        tick(3)
        assert capsys.readouterr().err == f"\r{'█' * 15}{'·' * 15} 4 of 8 cells, 2 s left "
        clock[0] = 2.05  # too soon for another
        tick()
        assert capsys.readouterr().err == ""
    assert capsys.readouterr().err.strip() == ""


def test_without_a_terminal_a_line_is_written_every_half_minute(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    with Progress(4, "cells") as tick:
        for clock[0], line in ((29.0, ""), (31.0, f"{'█' * 15}{'·' * 15} 2 of 4 cells, 31 s left\n"), (60.0, "")):
            tick()
            assert capsys.readouterr().err == line
    assert capsys.readouterr().err == ""
