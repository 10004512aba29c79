"""Executors of the leaderboard: whoever computes the cells, the files are the same (`tests.hardening` kills one)."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest

from flexarm_agents.board import measure as measuring
from flexarm_agents.board.cells import Store
from flexarm_agents.board.columns import Column, Point
from flexarm_agents.board.entries import Entry
from flexarm_agents.jobs.executors import executor
from tests.support.boards import files

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
def test_two_processes_give_the_same_files(tmp_path: Path, by_one_process: dict[str, bytes]) -> None:
    assert len(by_one_process) == len(REAL["delay"].points)
    assert measured(tmp_path, executor("processes", 2, tmp_path)) == by_one_process


@pytest.mark.slow
def test_submitit_gives_the_same_files(tmp_path: Path, by_one_process: dict[str, bytes]) -> None:
    pytest.importorskip("submitit", reason="the extra `slurm` is not installed")
    assert measured(tmp_path, executor("submitit-local", 2, tmp_path / "submitit")) == by_one_process


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # Ray's own: sockets left open, deprecations
def test_a_ray_cluster_of_which_a_node_is_killed_gives_the_same_files(
    tmp_path: Path, by_one_process: dict[str, bytes]
) -> None:
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
