"""The bar of a command, and the steps that it counts."""

from __future__ import annotations

import time
from io import StringIO

import gymnasium
import pytest

from flexarm_agents.commands import progress, sources
from flexarm_agents.commands.progress import episode_steps, progress_bar
from flexarm_env.envs.single import FlexArmEnv


class Terminal(StringIO):
    """Stands for a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.mark.parametrize("kind", [Terminal, StringIO])
def test_a_bar_is_shown_when_it_takes_long_and_goes_in_the_end(
    kind: type[StringIO], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress, "PATIENCE" if kind is Terminal else "LOG", 0.02)
    errors = kind()
    monkeypatch.setattr("sys.stderr", errors)
    with progress_bar(8, "cells") as bar:
        bar.update()
        assert errors.getvalue() == ""
        time.sleep(0.15)
        bar.update(3)
        assert "4/8" in errors.getvalue()
    assert errors.getvalue().rpartition("\r")[0].rpartition("\r")[2].strip() == ""  # the last line is blank


def test_how_long_an_episode_is() -> None:
    assert episode_steps(gymnasium.make("FlexArm/Square-v0", max_episode_steps=70)) == 70
    assert episode_steps(FlexArmEnv(control_period=0.02, lap_time=8.0)) == 400


def test_what_takes_longer_than_a_moment_is_said(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sources, "PATIENCE", 0.05)
    with sources._message_if_long("slow: the controller is designed"):
        before, waited = capsys.readouterr().err, 0
        while not (said := capsys.readouterr().err) and waited < 200:
            time.sleep(0.05)
            waited += 1
    assert before == ""
    assert said == "slow: the controller is designed\n"
    monkeypatch.setattr(sources, "PATIENCE", 60.0)
    with sources._message_if_long("quick: the controller is designed"):
        pass
    assert capsys.readouterr().err == ""
