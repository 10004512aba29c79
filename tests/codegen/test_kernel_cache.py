"""Compiled kernels on disk: never stale, never trusted blindly, compiled by one process, and not indispensable."""

import errno
import gc
import hashlib
import os
import pickle
import re
import runpy
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from stat import S_IMODE
from typing import Any

import filelock
import numba
import pytest

from flexarm_env.codegen import cache, cache_folder, compiler
from flexarm_env.envs.single import FlexArmEnv
from tests.codegen.conftest import Trap, give_away, raising, warnings_of, widen
from tests.support.refusals import refuses

NAME = "flexarm_tiny_1_1_0123456789abcdef"


def successor(x: float) -> float:
    return x + 1.0


def load() -> Any:
    """Return the kernel as a process has it that has just started."""
    kernel = numba.njit(successor)
    cache.keep(kernel, cache.KernelFolder(NAME, "a tiny kernel"))
    return kernel


def run(kernel: Any) -> bool:
    """Call it; True if it came from disk."""
    assert cache.call(kernel, 1.0) == 2.0
    return bool(sum(kernel.stats.cache_hits.values()))


def files(folder: Path) -> list[Path]:
    return sorted(folder.glob("*.nbc"))


def test_what_one_process_compiles_the_next_one_loads_and_only_the_first_says_so(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    kernel = load()
    assert not run(kernel)
    (line,) = warnings_of(caplog)
    assert re.fullmatch(rf"compiled in \d+\.\d s, kept in {re.escape(str(folder))}: a tiny kernel", line)
    assert cache.is_kept(kernel)
    assert run(load())
    assert warnings_of(caplog) == [line]


FILE = """
from flexarm_env.codegen.cache import kept_on_disk

compiled = kept_on_disk(__file__, "tiny functions")

@compiled
def successor(x):
    return x + 1.0

@compiled
def after_next(x):
    return successor(successor(x))
"""


def test_functions_of_a_file_are_kept_until_the_file_is_edited(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Not numba's cache, which knows no trust in folders and no damage."""

    def after_next(text: str) -> tuple[float, int]:
        """Return the result, and how often the code came from disk, as a process does that has just started."""
        (tmp_path / "tiny_file.py").write_text(text)
        names = runpy.run_path(str(tmp_path / "tiny_file.py"))
        return names["after_next"](1.0), sum(names["after_next"].stats.cache_hits.values())

    assert after_next(FILE) == (3.0, 0)
    (line,) = warnings_of(caplog)
    assert line.endswith(": tiny functions")
    assert after_next(FILE) == (3.0, 1)
    assert after_next(FILE.replace("x + 1.0", "x + 2.0")) == (5.0, 0)
    assert len(files(folder)) == 4
    assert not list(tmp_path.rglob("*.nbi"))


FUNCTIONS = """
def outer():
    "Text."
    def inner():
        "Inner text."
        return "value", list("text" for _ in "ab"), lambda: "text"
    return inner
"""


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [("Text.", "Other.", True), ("Inner text.", "Other.", True), ("value", "other", False), ('"text"', '"t"', False)],
)
def test_docstrings_alone_are_not_hashed(old: str, new: str, same: bool) -> None:
    """Also those of inner functions, which write an intrinsic's instructions."""

    def hashed(text: str) -> list[Any]:
        (outer,) = (one for one in compile(text, "", "exec").co_consts if hasattr(one, "co_code"))
        return [compiler._constants(code) for code in compiler._codes(outer)]

    assert (hashed(FUNCTIONS.replace(old, new)) == hashed(FUNCTIONS)) is same


DAMAGES: dict[str, Callable[[bytes], bytes]] = {
    "empty": lambda data: b"",
    "truncated": lambda data: data[: len(data) // 2],
    "a changed byte": lambda data: data[:-100] + bytes([data[-100] ^ 1]) + data[-99:],
    "appended": lambda data: data + b"\nraise SystemExit",
    "no pickle": lambda data: hashlib.sha256(b"").digest(),
    "another pickle": lambda data: hashlib.sha256(b"N.").digest() + b"N.",
}


def test_a_damaged_file_is_compiled_anew(folder: Path) -> None:
    run(load())
    (file,) = files(folder)
    for name, damage in DAMAGES.items():
        file.write_bytes(damage(file.read_bytes()))
        assert not run(load()), name
        assert files(folder) == [file]
        assert run(load()), name


@pytest.mark.parametrize("umask", [0o000, 0o002, 0o077])
def test_nobody_else_can_write_to_a_file_whatever_the_umask(folder: Path, umask: int) -> None:
    before = os.umask(umask)
    try:
        run(load())
    finally:
        os.umask(before)
    assert {S_IMODE(file.stat().st_mode) for file in folder.iterdir()} <= {0o600, 0o644}


def link(file: Path) -> None:
    file.rename(file.with_name("elsewhere"))
    file.symlink_to("elsewhere")


def pipe(file: Path) -> None:
    file.unlink()
    os.mkfifo(file)


@pytest.mark.parametrize("change", [widen, give_away, link, pipe])
def test_what_others_could_have_written_is_not_run_though_the_folder_is_safe(
    folder: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture, change: Callable[[Path], None]
) -> None:
    """As a file is that was there before `chmod go-w`."""
    kernel = load()
    run(kernel)
    (file,) = files(folder)
    payload = pickle.dumps(Trap(tmp_path / "mark"))
    trap = hashlib.sha256(payload).digest() + payload
    file.write_bytes(trap)
    change(file)
    assert not cache.is_kept(kernel)
    assert not run(load())
    assert not (tmp_path / "mark").exists()
    if change is not link:
        assert any(str(file) in line for line in warnings_of(caplog))
    assert run(load())
    file.write_bytes(trap)
    assert not run(load())
    assert (tmp_path / "mark").exists()  # the trap works


def test_source_code_in_the_folder_is_never_run(folder: Path) -> None:
    run(load())
    marker = folder / "marker"
    for path in (folder / f"{NAME}.py", folder / "successor.py", folder / "numba.py"):
        path.write_text(f"open({str(marker)!r}, 'w')")
    assert run(load())
    assert not marker.exists()
    assert not list(folder.rglob("*.pyc"))


def test_a_file_in_use_stays(folder: Path) -> None:
    run(load())
    (file,) = files(folder)
    os.utime(file, (0.0, time.time() - 89 * 86400.0))
    run(load())
    assert time.time() - file.stat().st_mtime < 3600.0


def test_without_a_folder_kernels_live_in_memory(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(cache, "find_folder", lambda: None)
    kernels = [load(), load()]
    assert not any(map(run, kernels))
    assert not cache.is_kept(kernels[0])
    found = [re.fullmatch(r"compiled in \d+\.\d s: a tiny kernel", line) for line in warnings_of(caplog)]
    assert [bool(one) for one in found] == [True, True]


def test_a_full_disk_costs_the_cache_only(
    folder: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(cache_folder.os, "replace", raising(OSError(errno.ENOSPC, "No space left on device")))
    kernel = load()
    assert not run(kernel)
    assert not cache.is_kept(kernel)
    assert not run(load())
    assert not [path for path in folder.iterdir() if path.suffix != ".lock"]
    (line,) = [line for line in warnings_of(caplog) if "No space" in line]
    assert str(folder) in line


@pytest.mark.parametrize("error", [OSError(errno.ENOLCK, "no locks"), NotImplementedError(), filelock.Timeout("x")])
def test_a_lock_that_cannot_be_had_costs_the_lock_only(
    folder: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
) -> None:
    monkeypatch.setattr(filelock.FileLock, "acquire", raising(error))
    assert not run(load())
    assert run(load())


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGSTOP])
def test_a_process_that_holds_the_lock_and_is_killed_or_stopped_blocks_nobody_for_ever(
    folder: Path, monkeypatch: pytest.MonkeyPatch, sent: signal.Signals
) -> None:
    folder.mkdir()
    hold = "import filelock, sys, time; filelock.FileLock(sys.argv[1]).acquire(); print(flush=True); time.sleep(60)"
    command = [sys.executable, "-c", hold, str(folder / f"{NAME}.lock")]
    with subprocess.Popen(command, stdout=subprocess.PIPE) as holder:
        try:
            holder.stdout.readline()  # type: ignore[union-attr]
            holder.send_signal(sent)
            if sent == signal.SIGKILL:
                holder.wait()
            monkeypatch.setattr(cache, "LONGEST_WAIT", 30.0 if sent == signal.SIGKILL else 0.2)
            begin = time.monotonic()
            assert not run(load())
            assert time.monotonic() - begin < 20.0
        finally:
            holder.kill()


def test_without_the_compiler_a_line_says_so_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(numba.config, "DISABLE_JIT", 1)
    for make in (cache.check_compiler, FlexArmEnv):
        with refuses(ValueError, "NUMBA_DISABLE_JIT = 1: must be 0, or not set"):
            make()


def test_a_failed_compilation_frees_lock_and_collector_and_the_next_one_says_what_it_took(
    folder: Path, caplog: pytest.LogCaptureFixture
) -> None:
    kernel = load()
    with pytest.raises(numba.TypingError):
        cache.call(kernel, "no number")
    assert gc.isenabled()
    with filelock.FileLock(folder / f"{NAME}.lock").acquire(blocking=False):
        pass
    run(kernel)
    assert len(warnings_of(caplog)) == 1
