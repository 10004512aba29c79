"""Files that scripts leave behind: strict JSON, and folders that are replaced only when the new one is complete."""

from __future__ import annotations

import json
import math
import os
import shutil
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np


def write_json(path: Path, data: Any) -> None:
    """Strict JSON: what is not finite becomes null. The file is complete or absent."""
    aside = path.with_name(f".{path.name}.tmp")
    aside.write_text(json.dumps(_plain(data), indent=1, allow_nan=False) + "\n")
    os.replace(aside, path)


def _plain(value: Any) -> Any:
    """The same as mappings, lists and numbers, with None for what is not finite."""
    if isinstance(value, Mapping):
        return {str(k): _plain(v) for k, v in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(v) for v in value]
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
    """An empty folder to fill, which takes the target's place at the end; after an error the target stays as it was.

    Args:
        target: where the results belong.
        marker: a file that a complete result folder holds.

    Raises:
        ValueError: if the target is something else than a result folder.
    """
    check_replaceable(target, marker)
    target.parent.mkdir(parents=True, exist_ok=True)
    work = Path(tempfile.mkdtemp(dir=target.parent, prefix=f".{target.name}-"))
    old = work.with_name(work.name + ".old")
    try:
        yield work
        os.chmod(work, 0o755)  # mkdtemp's folders are private
        if target.exists():
            os.replace(target, old)
        os.replace(work, target)
    finally:
        shutil.rmtree(work, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)
