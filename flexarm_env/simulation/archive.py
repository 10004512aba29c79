"""Npz files with a head: arrays by name, and beside them what is plain (JSON), with the number of the format."""

from __future__ import annotations

import json
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO, TypeVar
from zipfile import BadZipFile

import numpy as np
from numpy.lib.npyio import NpzFile
from numpy.typing import NDArray

Arrays = dict[str, NDArray[Any]]
Made = TypeVar("Made")


def write(path: str | Path, version: int, head: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write a file; not compressed, which would take most of a run.

    Args:
        path: of the file.
        version: of the format.
        head: plain values (JSON).
        arrays: by name; "head" is taken.
    """
    text = json.dumps({"format": version, **head})
    with open(path, "wb") as file:
        np.savez(file, head=np.array(text), **arrays)  # type: ignore[arg-type]


def read(path: str | Path, version: int, what: str, make: Callable[[dict[str, Any], Arrays], Made]) -> Made:
    """Read a file that `write` has written; nothing in it is executed.

    Args:
        path: of the file.
        version: of the format.
        what: is in the file, for the message, e.g. "Trajectory".
        make: that from the head and the arrays; what these lack is a `KeyError`, what does not fit another error.

    Raises:
        FileNotFoundError: if there is none.
        ValueError: if it is another file, a damaged one or one of another format, naming it and what is wrong.
    """
    with open(path, "rb") as stream:  # not by np.load, which leaves a damaged file open
        try:
            head, arrays = _contents(stream)
        except (ValueError, EOFError, BadZipFile, zlib.error) as error:
            raise ValueError(f"{path}: not a saved {what} ({error})") from error
    if head.get("format") != version:
        raise ValueError(f"{path}: format {head.get('format')}; this version reads {version}")
    try:
        return make(head, arrays)
    except KeyError as error:
        raise ValueError(f"{path}: not a saved {what} (no entry {error})") from error
    except (AttributeError, TypeError, ValueError) as error:
        raise ValueError(f"{path}: not a saved {what} ({error})") from error


def _contents(stream: BinaryIO) -> tuple[dict[str, Any], Arrays]:
    file = np.load(stream, allow_pickle=False)
    if not isinstance(file, NpzFile) or "head" not in file:
        raise ValueError("no entry 'head'")
    head = json.loads(str(file["head"]))
    if not isinstance(head, dict):
        raise ValueError("the entry 'head' is not a JSON object")
    return head, {name: file[name] for name in file.files if name != "head"}
