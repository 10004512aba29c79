"""Jobs: what is told and kept of those that failed, and what runs them (`tests.hardening` kills one)."""

import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from flexarm_agents.board import measure as measuring
from flexarm_agents.board.cells import Cell, Store, jobs_of
from flexarm_agents.board.columns import Column, Point
from flexarm_agents.board.entries import Entry
from flexarm_agents.board.episodes import LANES, shares
from flexarm_agents.jobs.executors import _own_error, _run_share, executor
from flexarm_agents.jobs.failures import LOG, Failure, check_failures
from tests.support.boards import files
from tests.support.refusals import refuses


def fails(job: int) -> int:
    raise KeyError(job)


def raised(error: Exception, cause: Exception) -> Exception:
    try:
        raise error from cause
    except Exception as found:
        return found


def test_each_failure_has_a_line_and_a_traceback(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "results"
    one = raised(ValueError("bad"), OSError("inner"))
    failed = [Failure("lqg", one), Failure("lqg", ValueError("bad")), Failure("nmpc", KeyError("x"))]
    with refuses(OSError, "3 failed, see above", "the others are kept", f"tracebacks: {folder / LOG}"):
        check_failures(failed, folder, "the others are kept")
    assert capsys.readouterr().err == "lqg: ValueError: bad\nnmpc: KeyError: 'x'\n"
    log = (folder / LOG).read_text()
    assert log.count("lqg:\n") == 2
    assert all(text in log for text in ("OSError: inner", "in raised", "KeyError: 'x'"))
    check_failures([], folder, "the others are kept")
    assert list(folder.iterdir()) == []
    assert str(Failure("lqg", AssertionError())) == "lqg: AssertionError: "
    assert "\n" not in str(Failure("lqg", ValueError("one\n  two")))


def test_what_failed_in_a_worker_brings_its_traceback() -> None:
    (error,) = pickle.loads(pickle.dumps(_run_share(fails, [7])))
    assert type(error) is KeyError
    assert "in fails" in error.__notes__[0]


def test_an_error_of_ray_is_that_of_the_job() -> None:
    cause = KeyError(7)
    error = Exception("ray::f()\n  in fails\nKeyError: 7")
    error.cause = cause  # type: ignore[attr-defined]
    assert _own_error(error) is cause
    assert cause.__notes__ == [str(error)]
    lost = Exception("the node died")
    assert _own_error(lost) is lost


ROWS = [Entry("square", "agent")]
BIG = {"lap_time": 8.0, "side": 6.0}
REAL = {
    "delay": Column("Delay", "ms", tuple(Point(x, BIG | {"delay": 1e-3 * x}, seeds=range(8)) for x in range(8)), 0.0)
}
"""Points for real workers, each with a job of its own."""


def measured(folder: Path, where: Any) -> dict[str, bytes]:
    measuring.measure(ROWS, REAL, Store(folder / "cells"), where)
    return files(folder / "cells")


@pytest.fixture(scope="module")
def by_one_process(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    folder = tmp_path_factory.mktemp("one")
    return measured(folder, executor("processes", 1, folder))


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["processes", "submitit-local"])
def test_two_workers_give_the_same_files(kind: str, tmp_path: Path, by_one_process: dict[str, bytes]) -> None:
    if kind == "submitit-local":
        pytest.importorskip("submitit", reason="the extra `slurm` is not installed")
    assert len(by_one_process) == len(REAL["delay"].points)
    assert measured(tmp_path, executor(kind, 2, tmp_path / "workers")) == by_one_process


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # Ray's own: sockets left open, deprecations
def test_a_ray_cluster_that_loses_a_node_gives_the_same_files(tmp_path: Path, by_one_process: dict[str, bytes]) -> None:
    ray = pytest.importorskip("ray", reason="the extra `ray` is not installed")
    from ray.cluster_utils import Cluster

    cluster = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    other = cluster.add_node(num_cpus=1)
    ray.init(address=cluster.address, log_to_driver=False, logging_level="error")
    try:
        cluster.wait_for_nodes()
        assert sum(node["Alive"] for node in ray.nodes()) == 2
        where = executor("ray", 2, tmp_path)

        class KillsANode:
            """Kills the second node, with what it is at, when the first job is done."""

            def run(self, function: Callable[[Any], Any], jobs: Sequence[Any]) -> Iterator[tuple[int, Any]]:
                for number, done in enumerate(where.run(function, jobs)):
                    if number == 0:
                        cluster.remove_node(other, allow_graceful=False)
                    yield done

        assert measured(tmp_path, KillsANode()) == by_one_process
        limit = time.monotonic() + 120.0  # until Ray declares the node dead
        while sum(node["Alive"] for node in ray.nodes()) > 1:
            assert time.monotonic() < limit
            time.sleep(0.2)
    finally:
        ray.shutdown()
        cluster.shutdown()


def test_a_group_has_at_most_as_many_episodes_as_a_batch() -> None:
    found = list(shares([2] * 7 + [10, 40, 2]))
    assert found == [list(range(7)), [7], [8], [9]]
    assert sum([2] * 7) <= LANES
    assert list(shares([])) == []


def test_one_job_has_all_of_a_task_that_is_not_the_entrys_own() -> None:
    row, other = Entry("square"), Entry("lqg")
    some = [Point(n, task=task) for n, task in enumerate(["square", "pace9", "carry", "pace9", *["square"] * LANES])]
    jobs = jobs_of([Cell.of(entry, point) for entry in (row, other) for point in some])
    found = [(job[0].entry, {cell.point.task for cell in job}, len(job)) for job in jobs]
    half = LANES // 2  # of two laps each
    of_each = [({"carry"}, 1), ({"pace9"}, 2), ({"square"}, half), ({"square"}, half), ({"square"}, 1)]
    assert found == [(entry, *one) for entry in (row, other) for one in of_each]
