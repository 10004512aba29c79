"""Npz files with a head: arrays by name, and beside them what is plain (JSON), with the number of the format.

A file may come from a stranger. Nothing in it is executed; nothing in it is compressed, so that reading takes no more
memory than the file has bytes; what each array is (type and shape) is checked before its numbers are read; and whatever
is wrong with it ends in a `ValueError`.
"""

from __future__ import annotations

import json
import math
import os
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from stat import S_ISDIR, S_ISREG
from typing import Any, NamedTuple, TypeVar
from zipfile import ZIP_STORED, ZipFile, ZipInfo

import numpy as np
from numpy.typing import NDArray

from flexarm_env.validation import short, shown

Arrays = dict[str, NDArray[Any]]
Made = TypeVar("Made")
LARGEST_HEAD = 1_000_000  # characters, each of four bytes
_ENCRYPTED = 1  # the bit of a zip entry's flags
_READERS = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}


class Entry(NamedTuple):
    """What an array is.

    Attributes:
        dtype: type of its numbers.
        shape: its shape.
    """

    dtype: np.dtype[Any]
    shape: tuple[int, ...]


def write(path: str | Path, version: int, head: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
    """Write a file; not compressed, which would take most of a run.

    Args:
        path: path of the file.
        version: version of the format.
        head: plain values (JSON).
        arrays: by name; "head" is taken.

    Raises:
        ValueError: if the head is longer than `LARGEST_HEAD`.
        TypeError: if it has a value that JSON lacks.
    """
    text = json.dumps({"format": version, **head})
    if len(text) > LARGEST_HEAD:
        raise ValueError(f"notes: take {len(text)} characters as JSON; at most {LARGEST_HEAD} are allowed")
    with open(path, "wb") as file:
        np.savez(file, head=np.array(text), **arrays)  # type: ignore[arg-type]


def read(
    path: str | Path,
    version: int,
    what: str,
    check: Callable[[dict[str, Any], Mapping[str, Entry]], None],
    make: Callable[[dict[str, Any], Arrays], Made],
) -> Made:
    """Read a file that `write` has written; nothing in it is executed.

    Args:
        path: path of the file.
        version: version of the format.
        what: name of what is in the file, for messages, e.g. "Trajectory".
        check: refuses, by any error, a head and arrays that do not fit it; called before the arrays are read.
        make: makes the result from the head and the arrays.

    Raises:
        FileNotFoundError: if there is none.
        PermissionError, IsADirectoryError: if it cannot be read.
        ValueError: if it is another file, a damaged one or one of another format, naming it and what is wrong.
    """
    try:
        mode = os.stat(path).st_mode
        if not (S_ISREG(mode) or S_ISDIR(mode)):  # a device gives bytes for ever, and a pipe waits for them
            raise ValueError("must be a file, not a device or a pipe")
        stream = open(path, "rb")  # noqa: SIM115  (closed below; errors of opening are others than those of reading)
    except (FileNotFoundError, PermissionError, IsADirectoryError):
        raise
    except (OSError, ValueError) as error:  # no possible name, or no file
        raise ValueError(f"path = {shown(path)}: {error.args[-1]}") from None
    with stream, warnings.catch_warnings(action="error"):
        # Damage meets zipfile, zlib, json and numpy anywhere: any of their errors, and warnings, says that it is there.
        try:
            with ZipFile(stream) as file:
                members = _members(file, os.fstat(stream.fileno()).st_size)
                head = _head(file, members)
                if type(head.get("format")) is not int or head["format"] != version:
                    raise _FormatError(f"format {shown(head.get('format'))}; this version reads {version}")
                check(head, {name: _entry(file, info) for name, info in members.items()})
                arrays = {name: _array(file, info) for name, info in members.items()}
            return make(head, arrays)
        except _FormatError as error:
            raise ValueError(f"{path}: {error}") from None
        except KeyError as error:
            raise ValueError(f"{path}: not a saved {what} (no entry {short(str(error))})") from error
        except Exception as error:
            reason = short(str(error)) or type(error).__name__
            raise ValueError(f"{path}: not a saved {what} ({reason})") from error


def names(path: str | Path) -> list[str]:
    """Return the names of what a zip file holds, whatever that is; none of another file."""
    try:
        with ZipFile(path) as file:
            return file.namelist()
    except Exception:  # of damage, see `read`
        return []


class _FormatError(Exception):
    """The file is of another format."""


def _members(file: ZipFile, size: int) -> dict[str, ZipInfo]:
    """List the arrays in a file of so many bytes, by name, none of which is read."""
    members = {info.filename.removesuffix(".npy"): info for info in file.infolist()}
    if len(members) < len(file.infolist()):
        raise ValueError("an entry is there twice")
    for name, info in members.items():
        if info.flag_bits & _ENCRYPTED:
            raise ValueError(f"entry {shown(name)} is encrypted")
        if info.compress_type != ZIP_STORED:
            raise ValueError(f"entry {shown(name)} is compressed; must be as `numpy.savez` stores it")
    taken = sum(info.file_size for info in members.values())
    if taken > size:
        raise ValueError(f"the arrays take {taken} bytes, and the file has {size}")
    return members


def _head(file: ZipFile, members: dict[str, ZipInfo]) -> dict[str, Any]:
    info = members.pop("head")
    entry = _entry(file, info)
    if entry.dtype.kind != "U" or entry.shape or entry.dtype.itemsize > 4 * LARGEST_HEAD:
        raise ValueError(f"the entry 'head' is not a text of at most {LARGEST_HEAD} characters")
    head = json.loads(str(_array(file, info)))
    if not isinstance(head, dict):
        raise ValueError("the entry 'head' is not a JSON object")
    return head


def _entry(file: ZipFile, info: ZipInfo) -> Entry:
    """Read the type and shape of an array, which must fill its entry."""
    with file.open(info) as stream:
        version = np.lib.format.read_magic(stream)
        if version not in _READERS:
            raise ValueError(f"entry {shown(info.filename)} is of the npy format {version}")
        shape, _, dtype = _READERS[version](stream)
        size = stream.tell() + math.prod(shape) * dtype.itemsize
    if min(shape, default=0) < 0 or size != info.file_size:
        raise ValueError(f"entry {shown(info.filename)} should have {size} bytes, not {info.file_size}")
    return Entry(dtype, shape)


def _array(file: ZipFile, info: ZipInfo) -> NDArray[Any]:
    with file.open(info) as stream:
        array: NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
    return array
