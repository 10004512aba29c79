"""Files that scripts leave behind: strict JSON, and folders that are replaced only when the new one is complete."""

from __future__ import annotations

import math
import os
import re
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from flexarm_agents.files import json_text, put

try:
    import fcntl
except ImportError:  # Windows: leftovers of killed runs stay
    fcntl = None  # type: ignore[assignment]

PARTIAL, OLD = ".partial", ".old"  # results being made; results about to be replaced


def write_json(path: Path, data: Any, levels: int | None = None) -> None:
    """Write strict JSON: what is not finite becomes null. The file is complete or absent.

    Args:
        path: of the file.
        data: mappings, lists, arrays and numbers.
        levels: levels of nesting whose items have lines of their own; None: all.
    """
    text = json_text(plain(data), levels)
    put(path, lambda aside: aside.write_text(text))


def plain(value: Any) -> Any:
    """Convert to mappings, lists and numbers as JSON has them, with None for what is not finite."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def check_replaceable(folder: Path, marker: str) -> None:
    """Refuse to replace what is not a script's result folder.

    Args:
        folder: what would be replaced.
        marker: a file that a complete result folder holds.

    Raises:
        ValueError: naming the path.
    """
    if folder.exists() and not (folder.is_dir() and ((folder / marker).exists() or not any(folder.iterdir()))):
        raise ValueError(f"output = {folder}: exists and holds no {marker}, so it is no result folder to replace")


@contextmanager
def replacing(target: Path, marker: str) -> Iterator[Path]:
    """Fill an empty folder that replaces the target at the end; after an error the target stays as it was.

    What runs that were killed left beside the target is removed first. A run that is alive holds a lock on its folder.

    Args:
        target: where the results belong.
        marker: a file that a complete result folder holds.

    Raises:
        ValueError: if the target is something else than a result folder.
    """
    check_replaceable(target, marker)
    target.parent.mkdir(parents=True, exist_ok=True)
    with ExitStack() as stack:
        with _locked(target.parent, wait=True):  # nobody takes a folder for a leftover before it is locked
            _sweep(target)
            work = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}-", suffix=PARTIAL))
            stack.enter_context(_locked(work))
            stack.callback(_clear, target, work)
        yield work
        os.chmod(work, 0o755)  # mkdtemp's folders are private
        if target.exists():
            os.replace(target, work.with_suffix(OLD))
        os.replace(work, target)


def _clear(target: Path, work: Path) -> None:
    """Remove a run's work folder and the results that it replaced; put these back if nothing took their place."""
    old = work.with_suffix(OLD)
    if old.exists() and not target.exists():
        os.replace(old, target)
    for folder in (work, old):
        shutil.rmtree(folder, ignore_errors=True)


def _sweep(target: Path) -> None:
    """Clear what killed runs left beside a target."""
    ours = re.compile(rf"\.{re.escape(target.name)}-[a-z0-9_]{{8}}({re.escape(PARTIAL)}|{re.escape(OLD)})")
    for work in {path.with_suffix(PARTIAL) for path in target.parent.iterdir() if ours.fullmatch(path.name)}:
        with _locked(work) as free:
            if free:
                _clear(target, work)


@contextmanager
def _locked(folder: Path, wait: bool = False) -> Iterator[bool]:
    """Lock a folder until the block, or the process, ends.

    Yields:
        Whether the folder is ours now, or is not there. False where the system cannot lock folders.
    """
    if fcntl is None:
        yield False
        return
    try:
        handle = os.open(folder, os.O_RDONLY)
    except FileNotFoundError:
        yield True
        return
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        free = True
    except OSError:  # another's, or a file system without locks
        free = False
    try:
        yield free
    finally:
        os.close(handle)
