"""What tests of the cache of kernels share: a folder of their own, and who else could write to a place."""

import logging
import os
from pathlib import Path
from typing import Any

import pytest

from flexarm_env.codegen import cache_folder


class Trap:
    """Makes a file as soon as it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self) -> tuple[Any, ...]:
        return Path.touch, (self.mark,)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv(cache_folder.VARIABLE, str(tmp_path / "cache"))
    cache_folder.say_once.cache_clear()
    cache_folder.remove_unused_files_once.cache_clear()
    return tmp_path / "cache"


def warnings_of(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


def widen(place: Path) -> None:
    place.chmod(place.stat().st_mode | 0o020)


def raising(error: Exception) -> Any:
    def refuse(*arguments: Any, **named: Any) -> None:
        raise error

    return refuse


def give_away(place: Path) -> None:
    if os.getuid() != 0:
        pytest.skip("only root can give something away")
    os.chown(place, 12345, -1, follow_symlinks=False)
