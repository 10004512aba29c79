"""The folder of compiled kernels: where it is, who may write to it, and what is removed from it.

Code in its files is run, so only this user and root may be able to write them.
"""

from __future__ import annotations

import logging
import os
import re
import tempfile
import time
import uuid
from contextlib import suppress
from functools import cache
from pathlib import Path
from stat import S_IMODE

import platformdirs

# Notices are warnings, as Matplotlib's about its font cache: these reach a user who has configured no logging, and the
# logger's name silences them.
logger = logging.getLogger("flexarm_env")

VARIABLE = "FLEXARM_CACHE_DIR"
DAY = 86400.0  # [s]
UNUSED = 90 * DAY  # after which a file is removed [s]
UNFINISHED = DAY  # the same, for a file that nobody finished writing
# Earlier versions named their files like this too.
_OUR_FILES = re.compile(r"flexarm_\w+_[0-9a-f]{16}[.-].+")
say_once = cache(logger.warning)


def find_folder() -> Path | None:
    """Find, or make, the folder of compiled kernels.

    It is FLEXARM_CACHE_DIR, else the user's cache folder, else one in the system's temporary folder. One rule holds for
    all of them: the folder belongs to this user or to root, and nobody else can write to it.

    Returns:
        The folder; None if there is none. FLEXARM_CACHE_DIR may be read-only, as one that was filled beforehand is.

    Raises:
        OSError: FLEXARM_CACHE_DIR is no folder, or others could place code in it.
    """
    chosen = os.environ.get(VARIABLE)
    if chosen:
        return _chosen_folder(chosen)
    owner = f"-{os.getuid()}" if hasattr(os, "getuid") else ""
    reasons: list[str] = []
    for folder in (Path(platformdirs.user_cache_dir("flexarm")), Path(tempfile.gettempdir()) / f"flexarm{owner}"):
        try:
            folder.mkdir(mode=0o755, parents=True, exist_ok=True)
            fault = _fault(folder)
        except OSError as error:
            fault = f"cannot be used ({error.strerror})"
        if fault is None and os.access(folder, os.W_OK | os.X_OK):
            if reasons:
                say_once(f"compiled kernels are kept in {folder}, since {reasons[0]}")
            return folder
        reasons.append(f"{folder} {fault or 'cannot be written to'}")
    say_once(f"kernels are compiled at every start, since {' and '.join(reasons)}; set {VARIABLE} to another folder")
    return None


def _chosen_folder(chosen: str) -> Path | None:
    folder = Path(chosen).absolute()
    try:
        folder.mkdir(mode=0o755, parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError):
        allowed = "a folder, or a path where one can be made"
        raise NotADirectoryError(f"{VARIABLE} = {chosen!r}: must be {allowed}") from None
    except OSError as error:
        say_once(f"kernels are compiled at every start: {VARIABLE} = {chosen!r} cannot be made ({error.strerror})")
        return None
    fault = _fault(folder)
    if fault is not None:
        raise PermissionError(
            f"{VARIABLE} = {chosen!r}: {fault}, and code in it is run; "
            "must be a folder of this user or of root, writable by no one else (chmod go-w)"
        )
    return folder


def _fault(folder: Path) -> str | None:
    """Say why code in a folder cannot be trusted; None if it can."""
    if not hasattr(os, "getuid"):
        return None
    for found in (folder.lstat(), folder.stat()):  # a link, and where it leads
        if found.st_uid not in (os.getuid(), 0):
            return f"belongs to another user ({found.st_uid})"
    if found.st_mode & 0o022:
        return f"can be written to by others (mode {S_IMODE(found.st_mode):04o})"
    return None


def remove_unused_files(folder: Path) -> None:
    """Remove files that no process has loaded for long, as those of other versions and of processes that were killed.

    Other processes may run meanwhile: one that misses a kernel compiles it, and two that hold different lock files
    compile the same.
    """
    now = time.time()
    for place in (folder, folder / "__pycache__"):  # numba's own cache lay there
        with suppress(OSError):
            for file in [entry for entry in place.iterdir() if _OUR_FILES.fullmatch(entry.name)]:
                with suppress(OSError):
                    longest = UNFINISHED if ".tmp" in file.name else UNUSED
                    if now - file.lstat().st_mtime > longest:
                        file.unlink()


remove_unused_files_once = cache(remove_unused_files)


def write_aside(path: Path, data: bytes) -> None:
    """Write a file aside and rename it, so that no process reads half of it."""
    aside = path.with_name(f"{path.name}.{uuid.uuid4().hex[:8]}.tmp")
    try:
        aside.write_bytes(data)
        os.replace(aside, path)
    except BaseException:
        with suppress(OSError):
            aside.unlink()
        raise


def note_use(path: Path) -> None:
    """Date a file that is in use, so that `remove_unused_files` leaves it; a read-only folder needs no date."""
    with suppress(OSError):
        if time.time() - path.stat().st_mtime > DAY:
            os.utime(path)
