"""Worker processes that never outlive their parent, however it ends.

A parent that ends early, by an error or a signal, kills its workers, or lets them stop where they can resume and waits
for them.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnContext, SpawnProcess
from multiprocessing.process import BaseProcess
from typing import Any

from flexarm_agents.jobs.stopping import STOPPING, StopSignals, TrainingStopped, ask_to_stop, is_asked_to_stop

GLANCE = 0.1  # between two looks for a second signal [s]


class WorkerPool:
    """Processes that run jobs; made by `worker_pool`."""

    def __init__(self, executor: ProcessPoolExecutor) -> None:
        """Keep the executor."""
        self._executor = executor

    def submit(self, job: Callable[..., Any], *arguments: Any) -> Future[Any]:
        """Call `job` in a worker; see `Executor.submit`.

        A worker begins with the signals blocked that ask a script to stop: the parent handles them, and a
        terminal sends Ctrl-C to both.
        """
        with _blocked_signals():
            return self._executor.submit(_carry_out, job, *arguments)


class _Spawning(SpawnContext):
    """Spawns processes, and lists them: the caller may have other children, which must not be killed.

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
def worker_pool(count: int, stoppable: bool = False) -> Iterator[WorkerPool]:
    """Worker processes for a block.

    After an error, or a signal, workers are killed at once, and jobs in progress are lost; stoppable ones are waited
    for, until a second signal comes. If the parent is killed itself, its workers notice and end.

    Args:
        count: how many.
        stoppable: the jobs stop on `StopSignals`.
    """
    context = _Spawning()
    asked, asking = context.Pipe(duplex=False)  # the end of this pipe is the request to stop
    with _blocked_signals():  # this starts multiprocessing's resource tracker, which does not handle SIGHUP
        executor = ProcessPoolExecutor(count, mp_context=context, initializer=_follow_parent, initargs=(asked,))
    try:
        yield WorkerPool(executor)
    except BaseException:
        # In a thread, since it waits for the workers; without waiting, the executor would forget its own thread, which
        # may then close what the interpreter, as it ends, writes to.
        closing = threading.Thread(target=executor.shutdown, kwargs={"cancel_futures": True})
        closing.start()
        asking.close()
        workers = [one for one in multiprocessing.active_children() if one in context.made]
        if stoppable:
            _wait_for(workers)
        for worker in workers:
            worker.kill()
        for worker in workers:
            worker.join()
        closing.join()
        raise
    finally:
        executor.shutdown()
        asking.close()
        asked.close()


def _wait_for(workers: Sequence[BaseProcess]) -> None:
    """Wait until workers have ended, or a signal comes."""
    left = [worker for worker in workers if worker.is_alive()]
    with StopSignals() as stop:  # before the line, whose reader may send the other signal at once
        if left:
            sys.stderr.write("\nwaiting until the jobs can be resumed; another signal ends them at once\n")
        while left and stop.received is None:
            wait([worker.sentinel for worker in left], GLANCE)
            left = [worker for worker in left if worker.is_alive()]


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


def _follow_parent(asked: Connection) -> None:
    """Watch, in a worker, for the parent's request to stop, and for its end.

    Args:
        asked: ends when the workers are to stop. The system closes it, and the parent's sentinel, with the parent.
    """
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        if asked in wait([asked, parent.sentinel]):
            ask_to_stop()
            wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _carry_out(job: Callable[..., Any], *arguments: Any) -> Any:
    """Do a job in a worker, unless it is to stop: a pool queues one job more than it has workers."""
    if is_asked_to_stop():
        raise TrainingStopped(signal.SIGTERM, 0)
    return job(*arguments)
