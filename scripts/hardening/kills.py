"""`kill -9` at random moments: nothing is lost, nothing is half, and what comes out in the end is the same.

Each task is done once undisturbed. Then it is begun in another folder, killed, checked, and begun again, until it has
been killed as often as asked; the last run is left alone, and what it leaves is compared with the undisturbed one.
Half of the kills are of the main process alone, whose workers must end by themselves.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from flexarm_agents.policies.load import load_policy
from flexarm_agents.training.run_folder import RunFolder
from flexarm_env import Trajectory
from scripts.common.markdown import DOCS

LONGEST = 600.0  # of a task [s]
LEAST = 0.05  # before a kill [s]
MOST_FAULTS = 5
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
    """What is killed.

    Attributes:
        text: what it is, for the page.
        command: makes the arguments of Python for a folder, begun or not.
        check: checks that a folder holds nothing half, and returns how much it holds.
        result: returns what is compared in the end, from a folder and what the command printed.
        cache: the folder is the one of compiled kernels.
    """

    text: str
    command: Callable[[Path], list[str]]
    check: Callable[[Path], int]
    result: Callable[[Path, str], Any]
    cache: bool = False


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
        from flexarm_agents.training.checkpoint import load_checkpoint
        from flexarm_agents.training.config import TrainingConfig

        load_checkpoint(run.checkpoint, run.read_config(TrainingConfig))
    evaluations = run.evaluations.with_suffix(".json")
    return len(json.loads(evaluations.read_text())) if evaluations.exists() else 0


def _training(folder: Path, printed: str) -> Any:
    """Return the policies' weights, and the evaluations but for their times."""
    rows = json.loads((folder / "evaluations.json").read_text())
    policies = [load_policy(folder, last).policy for last in (False, True)]
    weights = [[array.tobytes() for array in (*one.weights, *one.biases, one.log_std)] for one in policies]
    return weights, [{name: value for name, value in row.items() if name != "seconds"} for row in rows]


def _board(folder: Path) -> list[str]:
    rows = "--rows ifdc joint_pd --columns nominal --jobs 2"
    return ["-m", "scripts.leaderboard", *rows.split(), "--output", str(folder)]


def _check_board(folder: Path) -> int:
    cells = list((folder / "cells").rglob("[0-9a-f]*.json"))
    for path in cells:
        json.loads(path.read_text())
    return len(cells)


def _board_files(folder: Path, printed: str) -> Any:
    """Return the board and its cells."""
    paths = [folder / "leaderboard.json", *(folder / "cells").rglob("[0-9a-f]*.json")]
    return {str(path.relative_to(folder)): path.read_bytes() for path in paths}


def _reproduce(folder: Path) -> list[str]:
    arguments = "--no-sweeps --no-figures --controllers ifdc --places tip --lap-time 4 --workers 2 --output"
    return ["-m", "scripts.paper", *arguments.split(), str(folder / "paper")]


def _check_reproduction(folder: Path) -> int:
    """Check that the results are complete or absent."""
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
    "training": Task("`flexarm train`, 1536 steps, resumed after each kill", _train, _check_training, _training),
    "leaderboard": Task(
        "`make leaderboard`, 2 entries on one axis, two workers",
        _board,
        _check_board,
        _board_files,
    ),
    "reproduction": Task(
        "`make reproduce`, the runs of one controller in 4 s, two workers", _reproduce, _check_reproduction, _reproduced
    ),
    "compiling": Task(
        "the first episode with an empty folder of kernels",
        lambda folder: ["-c", EPISODE],
        _compiled,
        lambda folder, printed: printed,
        cache=True,
    ),
}


def kill_often(name: str, count: int, seed: int, folder: Path) -> dict[str, Any]:
    """Kill a task at random moments.

    Args:
        name: of the task.
        count: how often.
        seed: of the moments.
        folder: for the results, which is made anew.

    Returns:
        How often it was killed, how often it came to its end with the result of the undisturbed one, how long that one
        took [s], and what was lost, half or different; after `MOST_FAULTS` of them it is enough.

    Raises:
        AssertionError: if the undisturbed task fails.
    """
    task, rng = TASKS[name], random.Random(f"{seed} {name}")
    shutil.rmtree(folder, ignore_errors=True)
    whole, killed = folder / "whole", folder / "killed"
    whole.mkdir(parents=True)
    began = time.monotonic()
    wanted = _finished(task, whole)
    takes = time.monotonic() - began
    kills = finished = 0
    faults: list[str] = []
    while kills < count and len(faults) < MOST_FAULTS:
        killed.mkdir()
        try:
            for _ in _killed_to_the_end(task, killed, wanted, count - kills, rng, takes):
                kills += 1
        except Exception as error:
            faults.append(f"kills, {name}, after {kills}: {type(error).__name__}: {error}")
        else:
            finished += 1
        shutil.rmtree(killed)
    shutil.rmtree(folder)
    return {"kills": kills, "finished": finished, "seconds": takes, "faults": faults}


def _killed_to_the_end(
    task: Task, folder: Path, wanted: Any, most: int, rng: random.Random, takes: float
) -> Iterator[None]:
    """Begin a task again after each kill; in the end let it end.

    Args:
        task: what is killed.
        folder: its folder.
        wanted: result of the undisturbed one.
        most: kills; there are fewer if the task is quicker than a moment that was drawn.
        rng: draws the moments.
        takes: time of the undisturbed one [s].

    Yields:
        After each kill.

    Raises:
        AssertionError: if something was lost, or comes out otherwise.
        Exception: if what is there cannot be read.
    """
    held, printed = 0, None
    for _ in range(most):
        printed = _run(task, folder, rng.uniform(LEAST, takes), alone=rng.random() < ALONE)
        if printed is not None:
            break
        yield
        now = task.check(folder)
        assert now >= held, f"held {held}, holds {now}"
        held = now
    found = _finished(task, folder) if printed is None else _result(task, folder, printed)
    assert found == wanted, "another result"


def _finished(task: Task, folder: Path) -> Any:
    """Run a task to its end, and return its result."""
    printed = _run(task, folder, LONGEST)
    assert printed is not None, f"{task.text}: takes longer than {LONGEST:g} s"
    return _result(task, folder, printed)


def _result(task: Task, folder: Path, printed: str) -> Any:
    """Check what a task has left, and return its result."""
    task.check(folder)
    return task.result(folder, printed)


def _run(task: Task, folder: Path, longest: float, alone: bool = False) -> str | None:
    """Run a task, and kill it if it takes longer; kill it with its workers if this process is interrupted.

    Args:
        task: what is run.
        folder: its folder, begun or not.
        longest: time that it has [s].
        alone: kill the main process alone.

    Returns:
        What it printed; None if it was killed.

    Raises:
        AssertionError: if it fails by itself, or workers go on without it.
    """
    with _begin(task, folder) as process:
        try:
            printed = process.communicate(timeout=longest)[0]
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
    assert process.returncode == 0, f"{task.text}: ends with status {process.returncode}"
    return printed


def _check_all_gone(group: int) -> None:
    """Wait until no process of a group runs.

    Raises:
        AssertionError: if one goes on.
    """
    until = time.monotonic() + LINGER
    while members := _members(group):
        assert time.monotonic() < until, f"processes {members} go on without their parent"
        time.sleep(0.05)


def _members(group: int) -> list[int]:
    """Return the processes of a group that run; one that has ended and was not waited for does not."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):  # it has just ended
            state, _, of = path.read_text().rpartition(")")[2].split()[:3]
            if int(of) == group and state != "Z":
                found.append(int(path.parent.name))
    return found


def _begin(task: Task, folder: Path) -> subprocess.Popen[str]:
    """Begin a task, with its workers in a group of processes of its own."""
    environment = os.environ | {"PYTHONPATH": str(DOCS.parent)}
    if task.cache:
        environment["FLEXARM_CACHE_DIR"] = str(folder)
    command = [sys.executable, *task.command(folder)]
    return subprocess.Popen(
        command,
        cwd=DOCS.parent,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
        start_new_session=True,
    )
