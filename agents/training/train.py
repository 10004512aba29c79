"""`train`: a training on a batch of arms, judged by the true score, with the best policy kept."""

import pickle
import platform
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import torch

from flexarm_agents.code_version import code_version
from flexarm_agents.environments import spec_of
from flexarm_agents.jobs.stopping import StopSignals
from flexarm_agents.training.config import RunConfig
from flexarm_agents.training.loop import Training, TrainingLoop
from flexarm_agents.training.run_folder import RunFolder
from flexarm_env.validation import shown

LIBRARIES = ("numpy", "numba", "torch", "stable_baselines3", "sb3_contrib", "gymnasium")
WITHOUT_PART = ("flexarm_agents.commands", "flexarm_env.envs.rendering", "flexarm_env.envs.documentation")


@dataclass(frozen=True)
class Outcome:
    """Result of a training.

    Attributes:
        folder: of the training.
        best: the evaluation of the best policy, a row of `evaluations.json`.
        last: the evaluation of the last policy.
    """

    folder: Path
    best: dict[str, Any]
    last: dict[str, Any]


def train(config: RunConfig, folder: str | Path | None = None, resume: bool = False, progress: bool = False) -> Outcome:
    """Train, on one thread; the same configuration gives the same numbers on the same machine, interrupted or not.

    Args:
        config: the configuration, of the algorithm's own class.
        folder: for the results; None: `config.folder`. See `RunFolder` for its files.
        resume: continue the interrupted training in the folder, from its last checkpoint.
        progress: show a bar if stderr is a terminal; without a bar, the logger "flexarm_agents" gets a line for each
            evaluation.

    Raises:
        TrainingStopped: a `KeyboardInterrupt`, after SIGINT (Ctrl-C) or SIGTERM in the main thread: the present
            rollout or round is finished and a checkpoint written. A second signal ends the process at once.
        ModuleNotFoundError: without the algorithm's package, naming the extra.
        FileExistsError: if the folder is not empty and is not to be resumed.
        FileNotFoundError: if there is no training to resume, or no such initial policy.
        ValueError: if the training in the folder has another configuration, or the environment, the curriculum or the
            initial policy do not fit the algorithm, or a checkpoint could not keep the environment.
    """
    try:
        pickle.dumps(spec_of(config.environment).kwargs)
    except (AttributeError, TypeError, pickle.PicklingError) as error:
        raise ValueError(
            f"environment = {shown(config.environment)}: checkpoints cannot keep its options ({error}); "
            "give each of its functions a name in a module"
        ) from None
    run = RunFolder(config.folder if folder is None else folder)
    training: Training = resolve_name(config.training)(config, run)
    run.enter(config, _versions(type(training).__module__), resume)
    with run.named(), one_thread(), StopSignals() as stop, closing(training):
        if run.checkpoint.exists():
            training.load()
        else:
            training.start()
        with closing(TrainingLoop(training, stop, progress)) as loop:
            loop.run()
    found = training.progress
    assert found.best is not None
    return Outcome(run.path, found.rows[found.best], found.rows[-1])


@cache
def _versions(module: str) -> dict[str, str]:
    """Return the versions of Python and the libraries, and the hash of the code of a training's module."""
    code = code_version([module, __name__], WITHOUT_PART)
    return {"python": platform.python_version(), "code": code} | {name: version(name) for name in LIBRARIES}


@contextmanager
def one_thread() -> Iterator[None]:
    """Limit torch to one thread: on small networks more of them only wait for each other."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(before)
