"""Files that are complete or absent, however the process that writes them ends; strict JSON."""

from __future__ import annotations

import json
import os
import secrets
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

_UNFINISHED = ".new-"
_FORGOTTEN = 86400.0  # age at which an unfinished file is removed [s]


def put(path: Path, write: Callable[[Path], Any]) -> None:
    """Write a file atomically: beside its place, then moved there; after an error nothing is left.

    Several processes may write the same file: each writes under a name of its own, and the last one stays. Unfinished
    files of killed processes are removed after a day.

    Args:
        path: path of the file; it keeps its ending while it is written.
        write: writes to the path it is given.
    """
    _sweep(path)
    aside = path.with_name(f"{_UNFINISHED}{secrets.token_hex(4)}-{path.name}")
    try:
        write(aside)
        os.replace(aside, path)
    finally:
        aside.unlink(missing_ok=True)


def _sweep(path: Path) -> None:
    """Remove old unfinished files of killed processes."""
    for other in path.parent.glob(f"{_UNFINISHED}*"):
        if other.name.endswith(f"-{path.name}"):
            with suppress(FileNotFoundError):  # it was finished meanwhile, or removed by another process
                if time.time() - other.stat().st_mtime > _FORGOTTEN:
                    other.unlink()


def check_place(name: str, path: Path) -> None:
    """Check that a file can be written to the path that a parameter gives, and make its folder.

    Raises:
        IsADirectoryError: if the path is a folder.
        NotADirectoryError: if it would be in a file.
        PermissionError: if its folder may not be written to.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        raise NotADirectoryError(f"{name} = {path}: must be in a folder, not in a file") from None
    if path.is_dir():
        raise IsADirectoryError(f"{name} = {path}: is a folder; must be a file")
    if not os.access(path.parent, os.W_OK):
        raise PermissionError(f"{name} = {path}: must be in a folder that may be written to")


def is_unfinished(path: Path) -> bool:
    """Return whether a file is the unfinished one of a killed process."""
    return path.name.startswith(_UNFINISHED)


def write_text(path: Path, text: str) -> None:
    """Write text; the file is complete or absent."""
    put(path, lambda aside: aside.write_text(text, encoding="utf-8"))


def write_json(path: Path, values: Any, levels: int | None = None) -> None:
    """Write strict JSON; see `json_text`. The file is complete or absent."""
    write_text(path, json_text(values, levels))


def json_text(values: Any, levels: int | None = None) -> str:
    """Write strict JSON; items of so many outer levels of nesting have lines of their own, None: all items."""
    return (json.dumps(values, indent=1, allow_nan=False) if levels is None else _lines(values, levels)) + "\n"


def _lines(value: Any, levels: int, margin: str = "") -> str:
    if not levels or not isinstance(value, dict | list) or not value:
        return json.dumps(value, allow_nan=False)
    inner = margin + " "
    if isinstance(value, list):
        items = [_lines(one, levels - 1, inner) for one in value]
    else:
        items = [f"{json.dumps(name)}: {_lines(one, levels - 1, inner)}" for name, one in value.items()]
    ends = "[]" if isinstance(value, list) else "{}"
    return ends[0] + ",".join(f"\n{inner}{item}" for item in items) + f"\n{margin}{ends[1]}"
