"""Files that scripts leave behind: strict JSON, and folders that are replaced only when the new one is complete."""

import math
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import filelock
import numpy as np

from flexarm_agents.files import json_text, write_text

PARTIAL, OLD = ".partial", ".old"  # results being made; results about to be replaced


def write_json(path: Path, data: Any, levels: int | None = None) -> None:
    """Write strict JSON, in which null stands for what is not finite; see `json_text`."""
    write_text(path, json_text(plain(data), levels))


def plain(value: Any) -> Any:
    """Convert to mappings, lists and numbers as JSON has them, with None for what is not finite."""
    if isinstance(value, Mapping):
        return {str(k): plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(v) for v in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


@contextmanager
def replacing(target: Path, marker: str) -> Iterator[Path]:
    """Fill an empty folder that replaces the target at the end; after an error the target stays as it was.

    What a killed run left beside the target is removed first. A target that is no result folder (one with the marker,
    the name of a file), or that another run makes now, is refused.
    """
    if target.exists() and not (target.is_dir() and ((target / marker).exists() or not any(target.iterdir()))):
        raise ValueError(f"output = {target}: exists and holds no {marker}, so it is no result folder to replace")
    target.parent.mkdir(parents=True, exist_ok=True)
    work, old, lock = (target.with_name(f".{target.name}{end}") for end in (PARTIAL, OLD, ".lock"))
    with ExitStack() as stack:
        with suppress(OSError, NotImplementedError):  # a file system without locks
            try:
                stack.enter_context(filelock.FileLock(lock, blocking=False))
            except filelock.Timeout as error:
                raise ValueError(f"output = {target}: another run makes it now; must be another folder") from error
        _clear(target, work, old)
        stack.callback(_clear, target, work, old, lock)
        work.mkdir()
        yield work
        if target.exists():
            os.replace(target, old)
        os.replace(work, target)


def _clear(target: Path, work: Path, old: Path, *locks: Path) -> None:
    """Remove a work folder and the results that it replaced; put these back if nothing took their place."""
    if old.exists() and not target.exists():
        os.replace(old, target)
    for folder in (work, old):
        shutil.rmtree(folder, ignore_errors=True)
    for lock in locks:
        with suppress(OSError):  # Windows removes it when it is let go
            lock.unlink()
