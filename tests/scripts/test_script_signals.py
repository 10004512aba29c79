"""Scripts that are stopped by signals, as real processes: nothing goes on running, nothing half made stays."""

import ast
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, closing
from pathlib import Path

import psutil
import pytest

from flexarm_agents.jobs import worker_pool as worker_pool_module
from flexarm_agents.jobs.worker_pool import worker_pool
from scripts.common.result_files import OLD, PARTIAL, replacing, write_json
from tests.support.programs import ROOT, run_bare
from tests.support.signals import heeded

pytestmark = [pytest.mark.skipif(os.name != "posix", reason="POSIX signals"), pytest.mark.usefixtures("signals")]

# A script as ours are. Its jobs sleep, or wait like a training until they are to stop; each worker leaves a file named
# after its process.
SCRIPT = """
import os, sys, time
from pathlib import Path
from flexarm_agents.jobs.executors import Processes
from flexarm_agents.jobs.stopping import StopSignals, TrainingStopped
from scripts.common.command_line import run
from scripts.common.result_files import replacing

def sleeping(folder):
    (folder / str(os.getpid())).touch()
    time.sleep(600.0)

def training(folder):
    with StopSignals() as stop:
        (folder / str(os.getpid())).touch()
        while stop.received is None:
            time.sleep(0.01)
    Path(f"kept-{os.getpid()}-{time.monotonic_ns()}").touch()
    raise TrainingStopped(stop.received, 1)

def main():
    job, stoppable = globals()[sys.argv[1]], bool(int(sys.argv[2]))
    with replacing(Path("results"), "marker") as work:
        (work / "half").touch()
        for _, outcome in Processes(2).run(job, [Path("pids")] * 4, stoppable):
            raise outcome

if __name__ == "__main__":
    run(main)
"""
WAITING = "waiting until the jobs can be resumed; another signal ends them at once"


def wait_for(condition: Callable[[], object], seconds: float = 30.0) -> None:
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def is_running(process: int) -> bool:
    """Whether there is such a process that is no zombie."""
    try:
        return psutil.Process(process).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


class Running:
    """The script at work, with both workers busy."""

    def __init__(self, folder: Path, job: str = "sleeping", stoppable: bool = False) -> None:
        self.folder = folder
        self.pids = folder / "pids"
        self.pids.mkdir(exist_ok=True)
        (folder / "script.py").write_text(SCRIPT)
        command = [sys.executable, "script.py", job, str(int(stoppable))]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        self.process = subprocess.Popen(
            command, cwd=folder, env=environment, stderr=subprocess.PIPE, text=True, start_new_session=True
        )
        wait_for(lambda: len(list(self.pids.iterdir())) == 2 and (folder / f".results{PARTIAL}" / "half").exists())
        self.workers = [int(path.name) for path in self.pids.iterdir()]

    def errors(self) -> str:
        return self.process.communicate(timeout=30)[1].strip()

    def send(self, number: signal.Signals, to_all: bool) -> None:
        """Send a signal; a terminal sends Ctrl-C to the workers, too."""
        (os.killpg if to_all else os.kill)(self.process.pid, number)

    def close(self) -> None:
        for process in (self.process.pid, *self.workers):
            if is_running(process):
                os.kill(process, signal.SIGKILL)
        self.process.wait()
        assert self.process.stderr is not None
        self.process.stderr.close()


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_that_the_caller_ignores_ends_what_a_test_starts(number: signal.Signals) -> None:
    before = signal.signal(number, signal.SIG_IGN)
    try:
        with heeded():
            killed = f"import os; os.kill(os.getpid(), {number:d})"
            done = subprocess.run([sys.executable, "-c", killed], capture_output=True, check=False)
        assert done.returncode == -number
        assert signal.getsignal(number) == signal.SIG_IGN
    finally:
        signal.signal(number, before)


def test_an_error_ends_the_pools_workers_and_threads_and_no_other_child() -> None:
    """A thread that went on could close, while the interpreter ends, what that writes to."""
    children = [multiprocessing.get_context("spawn").Process(target=time.sleep, args=(600.0,)) for _ in range(2)]
    workers: list[int] = []

    def work() -> None:
        with worker_pool(1) as pool:
            workers.append(pool.submit(os.getpid).result())
            children[1].start()
            pool.submit(time.sleep, 600.0)
            raise KeyError

    threads = set(threading.enumerate())
    try:
        children[0].start()
        with pytest.raises(KeyError):
            work()
        assert not is_running(*workers)
        assert set(threading.enumerate()) <= threads
        assert all(child.is_alive() for child in children)
    finally:
        for child in children:
            child.kill()
            child.join()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Running]]:
    with ExitStack() as stack:
        yield lambda **given: stack.enter_context(closing(Running(tmp_path, **given)))


@pytest.fixture
def running(start: Callable[..., Running]) -> Running:
    return start()


@pytest.mark.parametrize(
    ("number", "to_all"),
    [(signal.SIGTERM, False), (signal.SIGHUP, False), (signal.SIGINT, True)],
    ids=["SIGTERM", "SIGHUP", "Ctrl-C"],
)
def test_a_stopped_script_leaves_nothing(running: Running, number: signal.Signals, to_all: bool) -> None:
    running.send(number, to_all)
    assert running.errors() == f"stopped by {number.name}"
    assert running.process.returncode == 128 + number
    assert not any(is_running(worker) for worker in running.workers)
    assert {path.name for path in running.folder.iterdir()} == {"pids", "script.py"}


@pytest.mark.parametrize(("number", "to_all"), [(signal.SIGTERM, False), (signal.SIGINT, True)])
def test_jobs_that_can_be_resumed_are_asked_to_stop(
    start: Callable[..., Running], number: signal.Signals, to_all: bool
) -> None:
    """Each keeps what it has; those that had not begun do not begin."""
    script = start(job="training", stoppable=True)
    script.send(number, to_all)
    assert script.errors().splitlines() == [WAITING, "", f"stopped by {number.name}"]
    assert script.process.returncode == 128 + number
    assert not any(is_running(worker) for worker in script.workers)
    left = sorted(path.name for path in script.folder.iterdir())
    assert sorted(int(name.split("-")[1]) for name in left[:-2]) == sorted(script.workers)
    assert left[-2:] == ["pids", "script.py"]


def test_a_second_signal_ends_jobs_that_are_waited_for(start: Callable[..., Running]) -> None:
    script = start(stoppable=True)
    script.send(signal.SIGTERM, to_all=False)
    assert script.process.stderr is not None
    assert [script.process.stderr.readline() for _ in range(2)] == ["\n", f"{WAITING}\n"]
    script.send(signal.SIGTERM, to_all=False)
    assert script.errors() == "stopped by SIGTERM"
    assert script.process.returncode == 128 + signal.SIGTERM
    assert not any(is_running(worker) for worker in script.workers)


def test_a_signal_that_comes_with_the_line_ends_the_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where signals were ignored until then, as they are once one has come."""

    class Reader:
        def write(self, line: str) -> None:
            os.kill(os.getpid(), signal.SIGTERM)

    job: Future[None] = Future()
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        with monkeypatch.context() as patched:
            patched.setattr(sys, "stderr", Reader())
            worker_pool_module._wait_for([job])
        assert not job.done()
    finally:
        signal.signal(signal.SIGTERM, before)


def test_workers_end_with_a_killed_parent_and_the_next_run_sweeps(running: Running) -> None:
    with pytest.raises(ValueError, match="another run makes it now"), replacing(running.folder / "results", "marker"):
        pass
    assert (running.folder / f".results{PARTIAL}" / "half").exists()
    running.process.kill()
    wait_for(lambda: not any(is_running(worker) for worker in running.workers))
    with replacing(running.folder / "results", "marker") as work:
        assert not list(work.iterdir())
        (work / "marker").touch()
    assert {path.name for path in running.folder.iterdir()} == {"pids", "script.py", "results"}


def test_a_worker_that_dies_ends_the_script(running: Running) -> None:
    os.kill(running.workers[0], signal.SIGKILL)
    assert "error: a worker process died" in running.errors()
    assert running.process.returncode == 1
    wait_for(lambda: not any(is_running(worker) for worker in running.workers))
    assert {path.name for path in running.folder.iterdir()} == {"pids", "script.py"}


def test_results_that_a_killed_run_had_moved_away_come_back(tmp_path: Path) -> None:
    """Killed between moving the old results away and putting the new ones in their place."""
    (tmp_path / f".results{OLD}").mkdir()
    (tmp_path / f".results{OLD}" / "marker").write_text("earlier")
    (tmp_path / f".results{PARTIAL}").mkdir()
    with pytest.raises(ZeroDivisionError), replacing(tmp_path / "results", "marker"):
        raise ZeroDivisionError
    assert (tmp_path / "results" / "marker").read_text() == "earlier"
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_json_that_cannot_be_written_leaves_no_file(tmp_path: Path) -> None:
    with pytest.raises(TypeError):
        write_json(tmp_path / "data.json", {"what": object()})
    assert not list(tmp_path.iterdir())


# Lies where programs look for numpy, which each imports before its work: the first second, made as long as it must be.
SLOW_LIBRARY = """
import os, signal, time
os.kill(os.getpid(), signal.{name})
time.sleep(60)
"""
PROGRAMS = {
    "the command": ("-c", "from flexarm_agents.commands import main; main(['list'])"),
    "a study": ("-m", "scripts.paper"),
    "a page": ("-m", "scripts.docs.environments"),
    "trainings": ("-m", "scripts.train", "--seeds", "0-3"),
}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("program", PROGRAMS.values(), ids=PROGRAMS)
def test_a_signal_while_importing_ends_with_one_line(
    program: tuple[str, ...], number: signal.Signals, tmp_path: Path
) -> None:
    (tmp_path / "numpy.py").write_text(SLOW_LIBRARY.format(name=number.name))
    ended = run_bare(sys.executable, *program, cwd=tmp_path, PYTHONPATH=f"{tmp_path}{os.pathsep}{ROOT}")
    assert (ended.returncode, ended.stdout, ended.stderr.strip()) == (128 + number, "", f"stopped by {number.name}")


def test_every_study_is_run_by_what_handles_its_end() -> None:
    for path in sorted((ROOT / "scripts").rglob("*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.If) and ast.unparse(node.test) == "__name__ == '__main__'":
                started = [one.value for one in ast.walk(node) if isinstance(one, ast.Expr)]
                names = {ast.unparse(call.func).split(".")[-1] for call in started if isinstance(call, ast.Call)}
                assert names == {"run"}, f"{path.relative_to(ROOT)}: {names}"
