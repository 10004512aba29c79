"""`kill -9` at random moments: nothing is lost, nothing is half, and what comes out in the end is the same.

Each task runs once undisturbed. Then it runs in another folder, is killed, checked and started again, as often as
wanted; the last run is left alone, and what it leaves is compared with the undisturbed one.
Half of the kills end the main process alone, whose workers must end by themselves.
"""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import mkdtemp
from typing import Any, NamedTuple

import psutil
import pytest

from flexarm_agents import PPOConfig
from flexarm_agents.policies.load import load_policy
from flexarm_agents.training.run_folder import RunFolder, read_checkpoint
from flexarm_env import Trajectory
from tests.hardening.strategies import amount
from tests.support.programs import ROOT

LONGEST = 600.0  # of a task [s]
LEAST = 0.05  # before a kill [s]
ALONE = 0.5  # share of the kills that leave workers without a parent
LINGER = 20.0  # time in which workers notice that their parent is gone [s]
FLEXARM = "from flexarm_agents.commands import main; main()"
EPISODE = """
import hashlib
import gymnasium
env = gymnasium.make("flexarm_env:FlexArm/Paper-v0")
found, _ = env.reset(seed=0)
digest = hashlib.sha256(found.tobytes())
for _ in range(50):
    digest.update(env.step(env.action_space.high)[0].tobytes())
print(digest.hexdigest())
"""


class Task(NamedTuple):
    command: Callable[[Path], list[str]]  # makes the arguments of Python for a folder, begun or not
    check: Callable[[Path], int]  # checks that a folder holds nothing half, and returns how much it holds
    # returns what is compared in the end, from a folder and what the command printed
    result: Callable[[Path, str], Any]
    cache: bool = False  # the folder is the one of compiled kernels


def _train(folder: Path) -> list[str]:
    arguments = "train --environment Square-v0 --seed 3 --envs 4 --rollout 32 --batch 64 --epochs 2 --steps 1536"
    arguments += " --hidden 16 8 --evaluate-every 500 --checkpoint-every 250 --episode-steps 50 --no-progress"
    resume = ["--resume"] if (folder / "config.json").exists() else []
    return ["-c", FLEXARM, *arguments.split(), "--folder", str(folder), *resume]


def _check_training(folder: Path) -> int:
    """Read all that a training leaves; return how many evaluations it has."""
    run = RunFolder(folder)
    for path in (run.best, run.last):
        if path.exists():
            load_policy(path)
    if run.checkpoint.exists():
        read_checkpoint(run.checkpoint, run.read_config(PPOConfig))
    evaluations = run.evaluations.with_suffix(".json")
    return len(json.loads(evaluations.read_text())) if evaluations.exists() else 0


def _training(folder: Path, printed: str) -> Any:
    """Return the policies' weights, and the evaluations but for their times."""
    rows = json.loads((folder / "evaluations.json").read_text())
    policies = [load_policy(folder, last).policy for last in (False, True)]
    weights = [[array.tobytes() for array in (*one.weights, *one.biases, one.log_std)] for one in policies]
    return weights, [{name: value for name, value in row.items() if name != "seconds"} for row in rows]


def _board(folder: Path) -> list[str]:
    rows = "--entries ifdc joint_pd --columns nominal --jobs 2"
    return ["-m", "scripts.leaderboard", *rows.split(), "--output", str(folder)]


def _check_board(folder: Path) -> int:
    cells = list((folder / "cells").rglob("[0-9a-f]*.json"))
    for path in cells:
        json.loads(path.read_text())
    return len(cells)


def _board_files(folder: Path, printed: str) -> Any:
    paths = [folder / "leaderboard.json", *(folder / "cells").rglob("[0-9a-f]*.json")]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def _reproduce(folder: Path) -> list[str]:
    arguments = "--no-sweeps --no-figures --controllers ifdc --places tip --lap-time 4 --workers 2 --output"
    return ["-m", "scripts.paper", *arguments.split(), str(folder / "paper")]


def _check_reproduction(folder: Path) -> int:
    results = folder / "paper"
    if not results.exists():
        return 0
    json.loads((results / "summary.json").read_text())
    for path in results.glob("runs/*.npz"):
        Trajectory.load(path)
    return 1


def _reproduced(folder: Path, printed: str) -> Any:
    runs = sorted((folder / "paper").glob("runs/*.npz"))
    left = sorted(path.name for path in folder.iterdir())
    return left, {path.name: {n: a.tobytes() for n, a in Trajectory.load(path).arrays().items()} for path in runs}


def _compiled(folder: Path) -> int:
    """Return how many kernels are kept; the next process checks each by its hash."""
    return len([path for path in folder.rglob("*") if path.is_file() and path.suffix != ".lock"])


TASKS = {
    "training": Task(_train, _check_training, _training),
    "leaderboard": Task(_board, _check_board, _board_files),
    "reproduction": Task(_reproduce, _check_reproduction, _reproduced),
    "compiling": Task(lambda folder: ["-c", EPISODE], _compiled, lambda folder, printed: printed, cache=True),
}


@pytest.mark.slow
@pytest.mark.skipif(os.name != "posix", reason="POSIX signals")
@pytest.mark.parametrize("name", TASKS)
def test_a_killed_task_loses_nothing(name: str, tmp_path: Path) -> None:
    task, rng = TASKS[name], random.Random(f"5 {name}")
    whole, kills, wanted = tmp_path / "whole", 0, amount(1, 20)
    whole.mkdir()
    began = time.monotonic()
    result = _finished(task, whole)
    takes = time.monotonic() - began
    while kills < wanted:
        killed = Path(mkdtemp(dir=tmp_path))
        kills += _kill(task, killed, wanted - kills, rng, takes)
        assert _finished(task, killed) == result


def _kill(task: Task, folder: Path, most: int, rng: random.Random, takes: float) -> int:
    """Begin and kill a task at random moments of the time it takes [s], until it is quicker; return how often."""
    held = 0
    for kills in range(most):
        if _run(task, folder, rng.uniform(LEAST, takes), alone=rng.random() < ALONE) is not None:
            return kills
        now = task.check(folder)
        assert now >= held, "something was lost"
        held = now
    return most


def _finished(task: Task, folder: Path) -> Any:
    """Run a task to its end, check what it leaves, and return its result."""
    printed = _run(task, folder, LONGEST)
    assert printed is not None, f"it takes longer than {LONGEST:g} s"
    task.check(folder)
    return task.result(folder, printed)


def _run(task: Task, folder: Path, longest: float, alone: bool = False) -> str | None:
    """Run a task; return what it printed, or None if it took longer [s] and was killed, alone or with its workers."""
    environment = os.environ | {"PYTHONPATH": str(ROOT)} | ({"FLEXARM_CACHE_DIR": str(folder)} if task.cache else {})
    own: dict[str, Any] = {"cwd": ROOT, "env": environment, "text": True, "start_new_session": True}
    command = [sys.executable, *task.command(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, **own) as process:
        try:
            printed: str = process.communicate(timeout=longest)[0]
        except subprocess.TimeoutExpired:
            if alone:
                process.kill()
                process.wait()
            else:
                os.killpg(process.pid, signal.SIGKILL)
            _check_all_gone(process.pid)
            return None
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    assert process.returncode == 0, f"it ends with status {process.returncode}"
    return printed


def _check_all_gone(group: int) -> None:
    until = time.monotonic() + LINGER
    while members := [one.pid for one in psutil.process_iter(["status"]) if _runs_in(group, one)]:
        assert time.monotonic() < until, f"processes {members} go on without their parent"
        time.sleep(0.05)


def _runs_in(group: int, process: psutil.Process) -> bool:
    """Return whether a process of a group runs; one that has ended and was not waited for does not."""
    try:
        return os.getpgid(process.pid) == group and process.info["status"] != psutil.STATUS_ZOMBIE
    except ProcessLookupError:  # it has just ended
        return False
