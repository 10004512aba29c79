"""The folder of compiled kernels: where it is, who may write to it, and what is removed from it.

Code in its files is run, so only this user and root may be able to write them, or to put others in their place: the
owners and modes of the folder, of all through which its path leads, and of each file that is read are checked.
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
from stat import S_IMODE, S_ISLNK, S_ISREG, S_ISVTX

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
    all of them: the folder belongs to this user or to root, and nobody else can write to it, or move it (`_fault`).

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
            _make(folder)
            fault = _fault(folder)
        except OSError as error:
            fault = f"{folder} cannot be used ({error.strerror})"
        if fault is None and os.access(folder, os.W_OK | os.X_OK):
            if reasons:
                say_once(f"compiled kernels are kept in {folder}, since {reasons[0]}")
            return folder
        reasons.append(fault or f"{folder} cannot be written to")
    say_once(f"kernels are compiled at every start, since {' and '.join(reasons)}; set {VARIABLE} to another folder")
    return None


def _chosen_folder(chosen: str) -> Path | None:
    folder = Path(chosen).absolute()
    try:
        _make(folder)
    except (FileExistsError, NotADirectoryError):
        allowed = "a folder, or a path where one can be made"
        raise NotADirectoryError(f"{VARIABLE} = {chosen!r}: must be {allowed}") from None
    except OSError as error:
        say_once(f"kernels are compiled at every start: {VARIABLE} = {chosen!r} cannot be made ({error.strerror})")
        return None
    fault = _fault(folder)
    if fault is not None:
        raise PermissionError(f"{VARIABLE} = {chosen!r}: {fault}")
    return folder


def _make(folder: Path) -> None:
    """Make a folder and those above it that are missing, writable by this user alone whatever the umask."""
    for place in (*reversed(folder.parents), folder):
        if not place.is_dir():
            place.mkdir(mode=0o755, exist_ok=True)


def _fault(folder: Path) -> str | None:
    """Say why code in a folder cannot be trusted; None if it can.

    As OpenSSH does, all through which the path leads is checked: who can write to a folder above can put another in its
    place. In a sticky folder, such as /tmp, nobody can do that to what belongs to this user.
    """
    if not hasattr(os, "getuid"):
        return None
    here, left = Path(folder.anchor), [*reversed(folder.parts[1:])]
    while True:
        found = here.lstat()
        fault = _fault_of(found, above=bool(left))
        if fault is not None:
            return (
                f"{here} {fault}, and code in the folder is run, which must be a folder of this user or of root, "
                "below such folders, writable by no one else (chmod go-w)"
            )
        if S_ISLNK(found.st_mode):
            target = here.readlink()
            here = here.parent / target.anchor
            left += reversed(target.relative_to(target.anchor).parts)
        elif left:
            part = left.pop()
            here = here.parent if part == ".." else here / part
        else:
            return None


def _fault_of(found: os.stat_result, above: bool = False) -> str | None:
    """Say who else can change a file or a folder; None if nobody can."""
    trusted = {os.getuid(), 0}
    if above:  # in a user namespace without root, as of a container, "/" and its like seem to be nobody's
        trusted.add(os.stat("/").st_uid)
    if found.st_uid not in trusted:
        return f"belongs to another user ({found.st_uid})"
    if found.st_mode & 0o022 and not S_ISLNK(found.st_mode) and not (above and found.st_mode & S_ISVTX):
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


def read_own(path: Path) -> bytes | None:
    """Read a file; None if there is none, or others could have written it: it may be older than the folder's mode."""
    try:
        with open(path, "rb", opener=_open_file) as file:
            found = os.fstat(file.fileno())
            fault = _fault_of(found) if hasattr(os, "getuid") else None
            if fault is None and S_ISREG(found.st_mode):
                return file.read()
    except OSError:
        return None
    say_once(f"{path} {fault or 'is no file'}, so it is not loaded")
    return None


def _open_file(path: str, flags: int) -> int:
    """Open the file itself, not what a link leads to; do not wait for the writer of a pipe."""
    return os.open(path, flags | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))


def write_aside(path: Path, data: bytes) -> None:
    """Write a file aside and rename it, so that no process reads half of it; only this user can write to it."""
    aside = path.with_name(f"{path.name}.{uuid.uuid4().hex[:8]}.tmp")
    try:
        with open(aside, "xb", opener=lambda name, flags: os.open(name, flags, 0o644)) as file:
            file.write(data)
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
