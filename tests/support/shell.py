"""The command `flexarm`, run in this process."""

import json
import sys
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from flexarm_agents.commands import main


class Printed(NamedTuple):
    stdout: str
    stderr: str


class Shell:
    def __init__(self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], folder: Path) -> None:
        self._capsys, self.folder = capsys, folder
        monkeypatch.chdir(folder)
        monkeypatch.setattr(sys, "path", list(sys.path))

    def __call__(self, *arguments: object, status: int = 0) -> Printed:
        """Run the command, which must end with this status."""
        code: Any = 0
        try:
            main([str(argument) for argument in arguments])
        except SystemExit as end:
            code = end.code
        printed = Printed(*self._capsys.readouterr())
        assert code == status, printed.stderr
        return printed

    def evaluation(self) -> dict[str, Any]:
        values: dict[str, Any] = json.loads((self.folder / "scores.json").read_text())
        return values
