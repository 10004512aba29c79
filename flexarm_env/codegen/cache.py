"""Keeps compiled kernels on disk: one process compiles them, once, and every later one loads them.

One file holds what numba compiled of a function for one list of argument types. The file's name carries a hash of all
that the function is made from (`compiler`, `kept_on_disk`), so that an edited formula can never meet stale code (numba
does not see edits in other files: numba issue 1833), and the file begins with a hash of its content, so that damage is
found and compiled anew. Without a folder (`cache_folder`), or room in it, kernels are compiled in memory, and a line
says so; without a lock, several processes compile the same.
"""

from __future__ import annotations

import gc
import hashlib
import os
import pickle
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar, cast

import filelock
import llvmlite
import numba
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.runtime.nrt import rtsys
from numba.core.serialize import dumps

from flexarm_env.codegen.cache_folder import (
    find_folder,
    logger,
    note_use,
    read_own,
    remove_unused_files_once,
    say_once,
    write_aside,
)
from flexarm_env.lazy import cached_property

LONGEST_WAIT = 600.0  # for another process that compiles the same kernels [s]; after that this one compiles too
F = TypeVar("F", bound=Callable[..., Any])
_DIGEST = hashlib.sha256().digest_size

# Held while this process compiles. A fork waits for it: a child does not have the thread that compiles, so numba's
# locks would stay taken in it for ever.
_COMPILING = threading.RLock()
if hasattr(os, "register_at_fork"):
    os.register_at_fork(
        before=_COMPILING.acquire, after_in_parent=_COMPILING.release, after_in_child=_COMPILING.release
    )


def check_compiler() -> None:
    """Check that numba compiles: kernels call instructions of the processor, which plain Python does not have.

    Raises:
        ValueError: if it is told not to.
    """
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        raise ValueError("NUMBA_DISABLE_JIT = 1: must be 0, or not set; the kernels of FlexArm run compiled only")


def kept_on_disk(file: str, description: str) -> Callable[[F], F]:
    """Return a decorator that compiles functions of a file when they are first called, and keeps them.

    They call others of the same file and of libraries only: what is kept is named by a hash of the file's text, and
    described to the user who waits.
    """
    check_compiler()
    path = Path(file)
    folder = KernelFolder(f"flexarm_{path.stem}_{hashlib.sha256(path.read_bytes()).hexdigest()[:16]}", description)

    def compiled(function: F) -> F:
        kernel: Any = numba.njit(function)
        keep(kernel, folder)
        return cast(F, kernel)

    return compiled


def keep(kernel: Any, folder: KernelFolder) -> None:
    """Keep what numba compiles of a function."""
    kernel._cache = _KernelCache(folder, kernel.py_func.__name__, kernel.targetctx)  # as numba does for files


def call(kernel: Any, *arguments: Any) -> Any:
    """Call a kernel, and compile it as `compiled_entry` does before its first call; argument types never change."""
    if not kernel.overloads:
        compiled_entry(kernel, *arguments)
    return kernel(*arguments)


def compiled_entry(kernel: Any, *arguments: Any) -> Callable[..., Any]:
    """Load or compile a kernel for arguments of these types, and return the compiled function.

    It takes arguments of these types only and skips the look-up of numba's dispatcher, which takes longer than entering
    a kernel. Of several processes that find nothing on disk one compiles; the others wait and load.
    """
    signature = tuple(map(numba.typeof, arguments))
    if signature not in kernel.overloads:
        with _COMPILING, _collector_paused(), kernel._cache.prepared(signature):
            kernel.compile(signature)
    return kernel.compile(signature)


def is_kept(kernel: Any) -> bool:
    """Say whether the next process finds on disk all that is compiled of a kernel."""
    return all(kernel._cache.is_kept(signature) for signature in kernel.overloads)


class KernelFolder:
    """Where the compiled functions of a variant or a file are kept.

    Attributes:
        name: of their files; it holds a hash of all that they are made from.
        description: for the user who waits.
    """

    def __init__(self, name: str, description: str) -> None:
        """Find the folder when it is first needed."""
        self.name, self.description = name, description
        self._begun: list[float] = []  # when the compilations at hand began: of a function, and of those that it calls

    @cached_property
    def path(self) -> Path | None:
        """The folder; None if nothing can be kept."""
        return find_folder()

    def begin(self) -> None:
        """Note that a compilation begins."""
        self._begun.append(time.perf_counter())

    def forget(self) -> None:
        """Forget compilations that failed."""
        self._begun.clear()

    def end(self) -> None:
        """Say what the user has waited for; functions that another one calls are compiled with it."""
        took = time.perf_counter() - self._begun.pop()
        if not self._begun:
            kept = f", kept in {self.path}" if self.path else ""
            logger.warning("compiled in %.1f s%s: %s", took, kept, self.description)

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Let one process compile while others wait.

        A process that cannot get the lock (on a file system without locks, or from a process that is stopped) compiles
        too. The system frees the lock of a process that is killed.
        """
        if self.path is None:
            yield
            return
        lock = filelock.FileLock(self.path / f"{self.name}.lock", mode=0o644)
        with suppress(OSError, NotImplementedError):
            try:
                lock.acquire(blocking=False)
            except filelock.Timeout:
                logger.info("waiting for another process that compiles kernels: %s", self.description)
                lock.acquire(timeout=LONGEST_WAIT)
        try:
            yield
        finally:
            with suppress(OSError):
                lock.release()


class _KernelCache(NullCache):
    """Compiled code of one function on disk, in the place of numba's own cache.

    numba's needs the source in a file, keeps an index that processes overwrite for each other, and fails with whatever
    its files hold.
    """

    def __init__(self, folder: KernelFolder, function: str, target_context: Any) -> None:
        self._folder, self._function, self._target_context = folder, function, target_context
        self._loaded: dict[Any, Any] = {}  # by `prepared`, for the `load_overload` that follows

    @contextmanager
    def prepared(self, signature: Any) -> Iterator[None]:
        """Load the function, or hold the lock while the caller compiles it."""
        if self._load(signature):
            yield
            return
        with self._folder.locked():
            try:
                yield
            finally:
                self._folder.forget()

    def is_kept(self, signature: Any) -> bool:
        """Say whether there is a file for arguments of these types that may be loaded."""
        path = self._path(signature)
        return path is not None and read_own(path) is not None

    # --- what numba calls ---------------------------------------------------------------------------------------

    @property
    def cache_path(self) -> str | None:
        """The folder."""
        return None if self._folder.path is None else str(self._folder.path)

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Load what was compiled for arguments of these types; None if there is nothing."""
        if not self._load(signature):
            self._folder.begin()
        return self._loaded.pop(signature, None)

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Keep what was compiled, if the folder takes it."""
        self._folder.end()
        path = self._path(signature)
        if path is None:
            return
        content = dumps(compiled._reduce())
        try:
            write_aside(path, hashlib.sha256(content).digest() + content)
        except OSError as error:
            say_once(f"kernels are compiled at every start: {path.parent} cannot be written to ({error.strerror})")
        else:
            remove_unused_files_once(path.parent)

    # --- inside -------------------------------------------------------------------------------------------------

    def _load(self, signature: Any) -> bool:
        if signature not in self._loaded:
            found = self._read(self._path(signature))
            if found is not None:
                self._loaded[signature] = found
        return signature in self._loaded

    def _read(self, path: Path | None) -> Any:
        if path is None:
            return None
        data = read_own(path)
        if data is None or hashlib.sha256(data[_DIGEST:]).digest() != data[:_DIGEST]:
            return None
        try:
            # What machine code links to. To refresh the whole context, as for a compilation, would take longer.
            rtsys.initialize(self._target_context)
            parts = pickle.loads(data[_DIGEST:])
            compiled = CompileResult._rebuild(self._target_context, *parts)
        except Exception:  # another build of the same versions wrote it; compiling anew replaces it
            return None
        note_use(path)
        return compiled

    def _path(self, signature: Any) -> Path | None:
        """Name the file for arguments of these types, this processor and these versions."""
        if self._folder.path is None:
            return None
        versions = (sys.implementation.cache_tag, numba.__version__, llvmlite.__version__)
        key = repr((signature, self._target_context.codegen().magic_tuple(), versions))
        digest = hashlib.sha256(key.encode()).hexdigest()[:16]
        return self._folder.path / f"{self._folder.name}.{self._function}.{digest}.nbc"


@contextmanager
def _collector_paused() -> Iterator[None]:
    """Stop Python's garbage collector, which would go again and again through the many objects of a compilation."""
    collecting = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collecting:
            gc.enable()
