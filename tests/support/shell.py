"""The command `flexarm`, run in this process."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from flexarm_agents.commands import main


class Ended(NamedTuple):
    """How the command ended, and what it printed."""

    returncode: int
    stdout: str
    stderr: str


class Shell:
    """Runs the command in this process, in a folder."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], folder: Path) -> None:
        self._capsys, self.folder = capsys, folder
        monkeypatch.chdir(folder)
        monkeypatch.setattr(sys, "path", list(sys.path))

    def __call__(self, *arguments: object) -> Ended:
        code: Any = 0
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as end:
            code = end.code
        return Ended(code, *self._capsys.readouterr())

    def evaluation(self) -> dict[str, Any]:
        values: dict[str, Any] = json.loads((self.folder / "scores.json").read_text())
        return values
