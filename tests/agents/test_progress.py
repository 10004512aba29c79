"""`Progress`: a line of the terminal, once it takes long, or lines of a log."""

from __future__ import annotations

import time

import gymnasium
import pytest

from flexarm_agents.commands import progress, sources
from flexarm_agents.commands.progress import Progress
from flexarm_agents.commands.watching import Watched, episode_steps
from flexarm_env.envs.single import FlexArmEnv


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
        assert capsys.readouterr().err == f"\r{'█' * 15}{'·' * 15} 4 of 8 cells, 1 s left "
        clock[0] = 2.05  # too soon for another
        tick()
        assert capsys.readouterr().err == ""
    assert capsys.readouterr().err.strip() == ""


def test_without_a_terminal_a_line_is_written_every_half_minute(
    clock: list[float], capsys: pytest.CaptureFixture[str]
) -> None:
    with Progress(4, "cells") as tick:
        for clock[0], line in ((29.0, ""), (31.0, f"{'█' * 15}{'·' * 15} 2 of 4 cells\n"), (60.0, "")):
            tick()
            assert capsys.readouterr().err == line
    assert capsys.readouterr().err == ""


def test_no_time_is_estimated_from_what_compiling_took(
    clock: list[float], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """The first of 3200 steps took a minute: "197313 s left"."""
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    with Progress(3200, "steps") as tick:
        for clock[0], steps, end in ((60.0, 1, "steps "), (61.0, 100, "steps "), (120.0, 1499, "steps, 60 s left ")):
            tick(steps)
            assert capsys.readouterr().err.endswith(end)


def test_each_step_of_an_episode_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    steps: list[int] = []
    env = FlexArmEnv()
    monkeypatch.setattr(env, "step", lambda action: (action, 0.0, False, False, {}))
    watched = Watched(env, lambda: steps.append(1))
    assert [watched.step(n)[0] for n in range(3)] == [0, 1, 2]
    assert len(steps) == 3


def test_how_long_an_episode_is() -> None:
    assert episode_steps(gymnasium.make("FlexArm/Square-v0", max_episode_steps=70)) == 70
    assert episode_steps(FlexArmEnv(control_period=0.02, lap_time=8.0)) == 400


def test_what_takes_longer_than_a_moment_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sources, "PATIENCE", 0.05)
    with sources._said_if_long("slow: the controller is designed"):
        before, waited = capsys.readouterr().err, 0
        while not (said := capsys.readouterr().err) and waited < 200:
            time.sleep(0.05)
            waited += 1
    assert before == ""
    assert said == "slow: the controller is designed\n"
    monkeypatch.setattr(sources, "PATIENCE", 60.0)
    with sources._said_if_long("quick: the controller is designed"):
        pass
    assert capsys.readouterr().err == ""
