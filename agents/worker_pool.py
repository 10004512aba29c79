"""Worker processes that never outlive their parent, however it ends."""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from typing import Any

from flexarm_agents.command_line import STOPPING


class WorkerPool:
    """Processes that run jobs; made by `worker_pool`."""

    def __init__(self, executor: ProcessPoolExecutor) -> None:
        """Keep the executor."""
        self._executor = executor

    def submit(self, job: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Have a worker call `job`; see `Executor.submit`.

        A worker begins with the signals blocked that ask a script to stop: they are its parent's business, and a
        terminal sends Ctrl-C to both.
        """
        with _blocked_signals():
            return self._executor.submit(job, *arguments)


class _Spawning(SpawnContext):
    """Spawns processes, and keeps them: the caller may have other children, which are not ours to kill.

    Attributes:
        made: the processes.
    """

    def __init__(self) -> None:
        super().__init__()
        self.made: list[SpawnProcess] = []

    def Process(self, *arguments: Any, **named: Any) -> SpawnProcess:  # type: ignore[override]
        """Make a process; see `multiprocessing.Process`."""
        self.made.append(SpawnProcess(*arguments, **named))
        return self.made[-1]


@contextmanager
def worker_pool(count: int) -> Iterator[WorkerPool]:
    """Worker processes for a block.

    After an error, or a signal, workers are killed at once; jobs in progress are lost. If the parent is killed itself,
    its workers notice and end.

    Args:
        count: how many.
    """
    context = _Spawning()
    with _blocked_signals():  # this starts multiprocessing's resource tracker, which knows nothing of SIGHUP
        executor = ProcessPoolExecutor(count, mp_context=context, initializer=_end_with_parent)
    try:
        yield WorkerPool(executor)
    except BaseException:
        executor.shutdown(wait=False, cancel_futures=True)
        workers = [one for one in multiprocessing.active_children() if one in context.made]
        for worker in workers:
            worker.kill()
        for worker in workers:
            worker.join()
        raise
    finally:
        executor.shutdown()


@contextmanager
def _blocked_signals() -> Iterator[None]:
    """Keep signals pending; a process started meanwhile has them blocked for good. Without masks, do nothing."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOPPING)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_with_parent() -> None:
    """Watch, in a worker, for the parent's end. Its sentinel is a pipe that the system closes with the parent."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
