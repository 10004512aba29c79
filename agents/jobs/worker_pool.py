"""Worker processes that never outlive their parent, however it ends.

A parent that ends early, by an error or a signal, kills its workers, or lets them stop where they can resume and waits
for them.
"""

import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import Future, ProcessPoolExecutor
from concurrent.futures import wait as wait_for
from contextlib import contextmanager
from multiprocessing.connection import Connection, wait
from typing import Any

from flexarm_agents.jobs.stopping import ASKED, STOPPING, StopSignals, TrainingStopped

GLANCE = 0.1  # between two looks for a second signal [s]


class WorkerPool(ProcessPoolExecutor):
    """Processes that run jobs, and stop when a pipe's end is closed; made by `worker_pool`."""

    def __init__(self, count: int, asked: Connection) -> None:
        self.jobs: list[Future[Any]] = []
        context = multiprocessing.get_context("spawn")
        with _blocked_signals():  # this starts multiprocessing's resource tracker, which does not handle SIGHUP
            super().__init__(count, mp_context=context, initializer=_follow_parent, initargs=(asked,))

    def submit(self, job: Callable[..., Any], /, *arguments: Any, **named: Any) -> Future[Any]:
        """Call `job` in a worker, whose signals are blocked: the parent handles them (a terminal sends both Ctrl-C)."""
        with _blocked_signals():
            self.jobs.append(super().submit(_carry_out, job, *arguments, **named))
        return self.jobs[-1]


@contextmanager
def worker_pool(count: int, stoppable: bool = False) -> Iterator[WorkerPool]:
    """Provide worker processes within `with`.

    After an error, or a signal, workers are killed at once, and jobs in progress are lost; stoppable ones are waited
    for, until a second signal comes. If the parent is killed itself, its workers notice and end.
    """
    asked, asking = multiprocessing.Pipe(duplex=False)  # the end of this pipe is the request to stop
    with asked, asking, WorkerPool(count, asked) as pool:
        try:
            yield pool
        except BaseException:
            asking.close()
            if stoppable:
                _wait_for(pool.jobs)
            for worker in [*(pool._processes or {}).values()]:  # the caller may have other children
                worker.kill()
            raise


def _wait_for(jobs: Collection[Future[Any]]) -> None:
    with StopSignals() as stop:  # before the line, whose reader may send the other signal at once
        if not all(job.done() for job in jobs):
            sys.stderr.write("\nwaiting until the jobs can be resumed; another signal ends them at once\n")
        while stop.received is None and wait_for(jobs, GLANCE).not_done:
            pass


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
    """Watch, in a worker, for the parent's request to stop, and for its end; the system closes both with the parent."""
    parent = multiprocessing.parent_process()
    assert parent is not None

    def watch() -> None:
        if asked in wait([asked, parent.sentinel]):
            ASKED.set()
            wait([parent.sentinel])
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def _carry_out(job: Callable[..., Any], *arguments: Any, **named: Any) -> Any:
    """Do a job in a worker, unless it is to stop: a pool queues one job more than it has workers."""
    if ASKED.is_set():
        raise TrainingStopped(signal.SIGTERM, 0)
    return job(*arguments, **named)
