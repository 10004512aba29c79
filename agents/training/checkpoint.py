"""Checkpoints: a training that is resumed from one ends in the same bits as one that was not interrupted."""

from __future__ import annotations

import json
import pickle
import zipfile
from pathlib import Path
from typing import Any

from flexarm_agents.files import put
from flexarm_agents.training.config import RunConfig
from flexarm_env.kernels.stamp import LayoutError
from flexarm_env.validation import short

_CONFIG, _STATE = "config.json", "state.pickle"


def write_checkpoint(path: Path, config: RunConfig, state: dict[str, Any]) -> None:
    """Write a file atomically."""

    def write(aside: Path) -> None:
        with zipfile.ZipFile(aside, "w") as file:
            file.writestr(_CONFIG, json.dumps(config.plain()))
            file.writestr(_STATE, pickle.dumps(state))

    put(path, write)


def read_checkpoint(path: Path, config: RunConfig) -> dict[str, Any]:
    """Read a checkpoint, which must be from a source that you trust: reading it can execute code.

    Returns:
        The state that was written.

    Raises:
        OSError: if the file cannot be opened.
        ValueError: if it is not a checkpoint, is damaged, belongs to a training of another configuration, or this
            version cannot continue it.
    """
    with path.open("rb") as stream:  # errors of opening are others than those of reading
        try:
            with zipfile.ZipFile(stream) as file:
                theirs = type(config).of(json.loads(file.read(_CONFIG)))
                state = file.read(_STATE)
        except Exception as error:  # damage meets zipfile and zlib anywhere: any of their errors says that it is there
            raise ValueError(f"{path}: not a checkpoint of this version ({short(str(error))})") from error
    config.check_same(theirs, path)
    try:
        found: dict[str, Any] = pickle.loads(state)
    except (pickle.UnpicklingError, EOFError) as error:
        raise ValueError(f"{path}: not a checkpoint ({error})") from error
    except (LayoutError, AttributeError, ImportError) as error:  # the last two: a name of another version
        raise ValueError(
            f"{path}: a checkpoint of another version ({error}); resume it with the version that wrote it, or train "
            "anew in another folder"
        ) from error
    return found
