"""Executors run jobs in processes of this machine, on a Ray cluster, or by Slurm; they share one protocol.

No executor retries a failed job: its result is missing, and the next run computes it. Ray itself moves jobs away from
a node that dies.
"""

import os
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import as_completed
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from flexarm_agents.jobs.worker_pool import worker_pool
from flexarm_env.extras import needs_extra
from flexarm_env.validation import choice, integer, shown

Outcomes = Iterator[tuple[int, Any]]  # of jobs, by their indices; of one that failed, the exception
EXECUTORS = ("processes", "ray", "slurm", "submitit-local")
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class Executor(Protocol):
    """Runs jobs."""

    def run(self, function: Callable[[Any], Any], jobs: Sequence[Any], stoppable: bool = False) -> Outcomes:
        """Run a function on each job.

        Args:
            function: of a module that every worker can import.
            jobs: its arguments; they and the results can be pickled.
            stoppable: the function stops on `StopSignals`. When this process is stopped, processes of this machine then
                stop where they can resume, and are waited for; those of Ray end at once; tasks of Slurm continue.

        Yields:
            The index of a job and its result, or what it raised, as soon as it is done.
        """


def executor(name: str, count: int, folder: Path, parameters: Mapping[str, Any] | None = None) -> Executor:
    """Return an executor by its name.

    Args:
        name: one of `EXECUTORS`.
        count: processes, or tasks of Slurm; Ray uses what its cluster has, and so many processes of a local one.
        folder: for submitit's own files; all machines must see it.
        parameters: of submitit, {"slurm_partition": ...} for example.
    """
    integer("jobs", count, 1)
    if parameters and name not in ("slurm", "submitit-local"):
        raise ValueError(f"parameters = {shown(parameters)}: are submitit's; executor = {name!r} has none")
    if choice("executor", name, EXECUTORS) == "processes":
        return Processes(count)
    if name == "ray":
        return Ray(count)
    return Submitit(count, folder, "slurm" if name == "slurm" else "local", parameters or {})


class Processes:
    """Processes of this machine."""

    def __init__(self, count: int) -> None:
        self.count = count

    def run(self, function: Callable[[Any], Any], jobs: Sequence[Any], stoppable: bool = False) -> Outcomes:
        """See `Executor.run`."""
        os.environ.update(THREADS)  # of workers, which start with this process's environment
        with worker_pool(min(self.count, len(jobs)), stoppable) as pool:
            waiting = {pool.submit(function, job): n for n, job in enumerate(jobs)}
            for done in as_completed(waiting):
                yield waiting[done], done.exception() or done.result()


class Ray:
    """A Ray cluster: the one that this process or machine is connected with, or a local one."""

    def __init__(self, count: int) -> None:
        with needs_extra("executor = 'ray'", "ray"):
            import ray
        self.ray, self.count = ray, count

    def run(self, function: Callable[[Any], Any], jobs: Sequence[Any], stoppable: bool = False) -> Outcomes:
        """See `Executor.run`."""
        ray = self.ray
        if started := not ray.is_initialized():
            quiet: dict[str, Any] = {"log_to_driver": False, "logging_level": "error"}
            try:
                ray.init(address=os.environ.get("RAY_ADDRESS", "auto"), **quiet)
            except ConnectionError:  # there is no cluster
                ray.init(num_cpus=self.count, include_dashboard=False, **quiet)
        try:
            remote = ray.remote(num_cpus=1, runtime_env={"env_vars": THREADS})(function)
            waiting = {remote.remote(job): n for n, job in enumerate(jobs)}
            while waiting:
                (done, *_), _ = ray.wait(list(waiting))
                n = waiting.pop(done)
                try:
                    yield n, ray.get(done)
                except ray.exceptions.RayError as error:
                    yield n, _own_error(error)
        finally:
            if started:
                ray.shutdown()


def _own_error(error: Exception) -> Exception:
    """Return what a job raised, with Ray's account of where as a note; Ray's own error where no job raised one."""
    cause = getattr(error, "cause", None)
    if not isinstance(cause, Exception):
        return error
    cause.add_note(str(error))
    return cause


class Submitit:
    """Tasks of Slurm, or processes, by submitit; each gets an equal share of the jobs."""

    def __init__(self, count: int, folder: Path, cluster: str, parameters: Mapping[str, Any]) -> None:
        with needs_extra(f"executor = {cluster!r}", "slurm"):
            import submitit
        self.submitit, self.count, self.folder, self.cluster = submitit, count, folder, cluster
        self.parameters = {"name": "flexarm", "cpus_per_task": 1, "timeout_min": 24 * 60, **parameters}

    def run(self, function: Callable[[Any], Any], jobs: Sequence[Any], stoppable: bool = False) -> Outcomes:
        """See `Executor.run`; the results of a task come together, when it is done."""
        chosen = self.submitit.AutoExecutor(folder=self.folder, cluster=self.cluster)
        chosen.update_parameters(**self.parameters)
        shares = [range(n, len(jobs), self.count) for n in range(min(self.count, len(jobs)))]
        tasks = chosen.map_array(partial(_run_share, function), [[jobs[n] for n in share] for share in shares])
        numbers = {task.job_id: share for task, share in zip(tasks, shares, strict=True)}
        for task in self.submitit.helpers.as_completed(tasks):
            error = task.exception()
            found = [error] * len(numbers[task.job_id]) if error is not None else task.result()
            yield from zip(numbers[task.job_id], found, strict=True)


def _run_share(function: Callable[[Any], Any], jobs: Sequence[Any]) -> list[Any]:
    """Run jobs one after the other; what one raises takes the place of its result."""
    results: list[Any] = []
    for job in jobs:
        try:
            results.append(function(job))
        except Exception as error:  # that of one job; the others go on
            error.add_note(traceback.format_exc())  # a pickled error has no traceback of its own
            results.append(error)
    return results
