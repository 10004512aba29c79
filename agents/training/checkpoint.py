"""Checkpoints: all that a training needs to go on; interrupted or not, its results are bitwise identical."""

from __future__ import annotations

import io
import json
import pickle
import random
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.buffers import ReplayBuffer
from stable_baselines3.common.vec_env import VecMonitor, unwrap_vec_wrapper

from flexarm_agents.files import put
from flexarm_agents.sb3.encoded_vec_env import EncodedVecEnv
from flexarm_agents.sb3.vec_env import FlexArmVecEnv
from flexarm_agents.training.config import RunConfig, TrainingConfig
from flexarm_agents.training.evaluator import TrainingProgress
from flexarm_agents.training.models import batch_for, model_class
from flexarm_env.kernels.stamp import LayoutError
from flexarm_env.validation import short

_CONFIG, _MODEL, _REST = "config.json", "model.zip", "rest.pickle"
_KEPT = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")  # arrays of a replay buffer


@dataclass(kw_only=True)
class Progress(TrainingProgress):
    """What a training has found out so far, and when it evaluates and saves next.

    Attributes:
        next_evaluation: steps at which the next one is due.
        next_checkpoint: steps.
    """

    next_evaluation: int
    next_checkpoint: int


def save_checkpoint(
    path: Path, config: TrainingConfig, model: BaseAlgorithm, progress: Progress, complete: bool = False
) -> None:
    """Write a checkpoint between two rollouts.

    Args:
        path: path of the file; complete or as before.
        config: configuration of the training.
        model: made by `models.new_model`.
        progress: progress of the training.
        complete: the training is over, so that what was to be learned from is not needed any more.
    """
    monitor = model.get_env()
    assert isinstance(monitor, VecMonitor)
    batch = monitor.unwrapped
    assert isinstance(batch, FlexArmVecEnv)
    encoded = unwrap_vec_wrapper(monitor, EncodedVecEnv)
    rest = {
        "progress": progress,
        "env": batch.env,
        "encoder": () if encoded is None else encoded.memory,
        "episodes": (monitor.episode_returns, monitor.episode_lengths),
        "lstm": getattr(model, "_last_lstm_states", None),
        "replay": None if complete else _replay(model),
        "random": (random.getstate(), np.random.get_state(), torch.get_rng_state()),  # noqa: NPY002  (what SB3 uses)
    }
    buffer = io.BytesIO()
    model.save(buffer)

    write_parts(path, config, {_MODEL: buffer.getvalue(), _REST: pickle.dumps(rest)})


def load_checkpoint(path: Path, config: TrainingConfig) -> tuple[BaseAlgorithm, Progress]:
    """Read a checkpoint, which must be from a source that you trust: reading it can execute code.

    Args:
        path: path of the file.
        config: configuration of the training.

    Returns:
        The model with its environments as they were, and the training's progress; the global random generators are
        set to what they were.

    Raises:
        ValueError: if the file is not a checkpoint of such a training, or one of a version whose batches this one
            cannot continue.
    """
    model_bytes, pickled = read_parts(path, config, (_MODEL, _REST))
    rest = unpickled(path, pickled)
    monitor = VecMonitor(batch_for(config, rest["env"]))
    monitor.episode_returns, monitor.episode_lengths = rest["episodes"]
    encoded = unwrap_vec_wrapper(monitor, EncodedVecEnv)
    if encoded is not None:
        encoded.memory = rest["encoder"]
    model = model_class(config.algorithm).load(io.BytesIO(model_bytes), env=monitor, device="cpu", force_reset=False)
    if rest["lstm"] is not None:
        model._last_lstm_states = rest["lstm"]
    _restore_replay(model, rest["replay"])
    python, numpy, torch_state = rest["random"]
    random.setstate(python)
    np.random.set_state(numpy)  # noqa: NPY002
    torch.set_rng_state(torch_state)
    return model, rest["progress"]


def write_parts(path: Path, config: RunConfig, parts: Mapping[str, bytes]) -> None:
    """Write a checkpoint's parts into one file, which is complete or as before.

    Args:
        path: path of the file.
        config: configuration of the training.
        parts: by name.
    """

    def write(aside: Path) -> None:
        with zipfile.ZipFile(aside, "w") as file:
            for name, content in {_CONFIG: json.dumps(config.plain()).encode(), **parts}.items():
                file.writestr(name, content)

    put(path, write)


def read_parts(path: Path, config: RunConfig, names: Iterable[str]) -> list[bytes]:
    """Read parts that `write_parts` wrote.

    Args:
        path: path of the file.
        config: configuration of the training that goes on.
        names: of the parts.

    Raises:
        OSError: if the file cannot be opened.
        ValueError: if it does not hold them, is damaged, or is the checkpoint of a training of another configuration.
    """
    with path.open("rb") as stream:  # errors of opening are others than those of reading
        try:
            with zipfile.ZipFile(stream) as file:
                theirs, *parts = [file.read(name) for name in (_CONFIG, *names)]
            began = type(config).of(json.loads(theirs))
        except Exception as error:  # damage meets zipfile and zlib anywhere: any of their errors says that it is there
            raise ValueError(f"{path}: not a checkpoint of this version ({short(str(error))})") from error
    config.check_same(began, path)
    return parts


def unpickled(path: Path, content: bytes) -> Any:
    """Read what a checkpoint keeps, which can execute code.

    Args:
        path: of the checkpoint, for messages.
        content: from it.

    Raises:
        ValueError: if it is damaged, or has what this version cannot continue.
    """
    try:
        return pickle.loads(content)
    except (pickle.UnpicklingError, EOFError) as error:
        raise ValueError(f"{path}: not a checkpoint ({error})") from error
    except (LayoutError, AttributeError, ImportError) as error:  # the last two: a name of another version
        raise ValueError(
            f"{path}: a checkpoint of another version ({error}); resume it with the version that wrote it, or train "
            "anew in another folder"
        ) from error


def _replay(model: BaseAlgorithm) -> dict[str, Any] | None:
    """Return what a replay buffer holds, as far as it is filled; None for an algorithm without one."""
    buffer = getattr(model, "replay_buffer", None)
    if not isinstance(buffer, ReplayBuffer):
        return None
    arrays = {name: getattr(buffer, name)[: buffer.size()].copy() for name in _KEPT}
    return {"pos": buffer.pos, "full": buffer.full, "arrays": arrays}


def _restore_replay(model: BaseAlgorithm, kept: dict[str, Any] | None) -> None:
    buffer = getattr(model, "replay_buffer", None)
    if kept is None or not isinstance(buffer, ReplayBuffer):
        return
    buffer.pos, buffer.full = kept["pos"], kept["full"]
    for name, values in kept["arrays"].items():
        getattr(buffer, name)[: len(values)] = values
