"""Checkpoints: all that a training needs to go on; interrupted or not, its results are bitwise identical."""

from __future__ import annotations

import io
import pickle
import random
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor

from flexarm_agents.evaluation import Found
from flexarm_agents.run_folder import put
from flexarm_agents.vec_env import FlexArmVecEnv
from flexarm_env.kernels.stamp import LayoutError

_MODEL, _REST = "model.zip", "rest.pickle"


@dataclass(kw_only=True)
class Progress(Found):
    """What a training has found out so far, and when it evaluates and saves next.

    Attributes:
        next_evaluation: steps at which the next one is due.
        next_checkpoint: steps.
    """

    next_evaluation: int
    next_checkpoint: int


def save_checkpoint(path: Path, model: PPO, progress: Progress) -> None:
    """Write a checkpoint between two rollouts.

    Args:
        path: path of the file; complete or as before.
        model: whose environment is a `VecMonitor` over a `FlexArmVecEnv`.
        progress: progress of the training.
    """
    monitor = model.get_env()
    assert isinstance(monitor, VecMonitor)
    assert isinstance(monitor.venv, FlexArmVecEnv)
    rest = {
        "progress": progress,
        "env": monitor.venv.env,
        "episodes": (monitor.episode_returns, monitor.episode_lengths),
        "random": (random.getstate(), np.random.get_state(), torch.get_rng_state()),  # noqa: NPY002  (what SB3 uses)
    }
    buffer = io.BytesIO()
    model.save(buffer)

    def write(aside: Path) -> None:
        with zipfile.ZipFile(aside, "w") as file:
            file.writestr(_MODEL, buffer.getvalue())
            file.writestr(_REST, pickle.dumps(rest))

    put(path, write)


def load_checkpoint(path: Path) -> tuple[PPO, Progress]:
    """Read a checkpoint, which must be from a source that you trust: reading it can execute code.

    Args:
        path: path of the file.

    Returns:
        The model with its environments as they were, and the training's progress; the global random generators are
        set to what they were.

    Raises:
        ValueError: if the file is not a checkpoint, or one of a version whose batches this one cannot continue.
    """
    try:
        with zipfile.ZipFile(path) as file:
            model_bytes, rest = file.read(_MODEL), pickle.loads(file.read(_REST))
    except (zipfile.BadZipFile, KeyError, pickle.UnpicklingError, EOFError) as error:
        raise ValueError(f"{path}: not a checkpoint ({error})") from error
    except (LayoutError, AttributeError, ImportError) as error:  # the last two: a name of another version
        raise ValueError(
            f"{path}: a checkpoint of another version ({error}); resume it with the version that wrote it, or train "
            "anew in another folder"
        ) from error
    monitor = VecMonitor(FlexArmVecEnv(rest["env"]))
    monitor.episode_returns, monitor.episode_lengths = rest["episodes"]
    model = PPO.load(io.BytesIO(model_bytes), env=monitor, device="cpu", force_reset=False)
    python, numpy, torch_state = rest["random"]
    random.setstate(python)
    np.random.set_state(numpy)  # noqa: NPY002
    torch.set_rng_state(torch_state)
    return model, rest["progress"]
