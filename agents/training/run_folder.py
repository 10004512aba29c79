"""`RunFolder`: what lies where in the folder of a training, written so that files are complete or absent.

A training that is resumed from a checkpoint ends in the same bits as one that was not interrupted.
"""

import csv
import json
import pickle
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

from flexarm_agents.files import is_unfinished, put, write_json
from flexarm_agents.training.config import RunConfig
from flexarm_env.kernels.stamp import LayoutError
from flexarm_env.validation import short

_FORMAT = 1
_CONFIG, _STATE = "config.json", "state.pickle"  # in a checkpoint
Config = TypeVar("Config", bound=RunConfig)


class RunFolder:
    """A training's folder: the paths of its files."""

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.config = self.path / "config.json"  # the configuration
        self.versions = self.path / "versions.json"  # of Python, the libraries and the code that began the training
        # A row for each evaluation, with the worst of its laps of either kind; `evaluations.json` holds the same.
        self.evaluations = self.path / "evaluations.csv"
        self.best = self.path / "best_policy.npz"  # the policy of the best evaluation, for `load_policy`
        self.best_model = self.path / "best_model.zip"  # the same as a stable-baselines3 model
        self.last = self.path / "last_policy.npz"  # the policy at the end
        self.initial = self.path / "initial_policy.npz"  # whose network the training began with, if there is one
        self.checkpoint = self.path / "checkpoint.zip"  # from which the training resumes
        self.curve = self.path / "learning_curve.png"  # drawn anew after each evaluation, where there is matplotlib
        self.laps = self.path / "laps.png"  # of the best policy at the end
        self.logs = self.path / "tensorboard"

    @contextmanager
    def named(self) -> Iterator[None]:
        """Within `with`, an error of the system that names no file, as that of a full disk, names the folder."""
        try:
            yield
        except OSError as error:
            if error.errno is None or error.filename is not None:
                raise
            raise OSError(error.errno, error.strerror, str(self.path)) from error

    def enter(self, config: RunConfig, versions: Mapping[str, str], resume: bool) -> None:
        """Make a new training's folder, with configuration and versions; or check that the one in it may go on.

        Raises:
            FileExistsError: if the folder of a new training holds anything but unfinished files.
        """
        if resume:
            config.check_same(self.read_config(type(config)), self.path)
            return
        if self.path.exists() and (
            not self.path.is_dir() or any(not is_unfinished(one) for one in self.path.iterdir())
        ):
            raise FileExistsError(
                f"folder = {self.path}: exists and is not empty; resume that training, remove it, or name another"
            )
        with self.named():
            self.path.mkdir(parents=True, exist_ok=True)
            write_json(self.config, {"format": _FORMAT, **config.plain()})
            write_json(self.versions, dict(versions))

    def read_config(self, kind: type[Config]) -> Config:
        """Read the configuration of the training in the folder.

        Raises:
            FileNotFoundError: if there is no training in it.
            ValueError: if the file is not a configuration of this class.
        """
        if not self.config.is_file():
            raise FileNotFoundError(f"folder = {self.path}: holds no {self.config.name}, so there is no training in it")
        try:
            values = json.loads(self.config.read_text(encoding="utf-8"))
            if values.pop("format") != _FORMAT:
                raise ValueError(f"this version reads format {_FORMAT}")
            return kind.of(values)
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise ValueError(f"{self.config}: not a training's configuration ({short(str(error))})") from error

    def write_evaluations(self, rows: list[dict[str, Any]]) -> None:
        """Write all evaluations, as CSV and as JSON."""
        write_json(self.evaluations.with_suffix(".json"), rows)
        flat = [_flat(row) for row in rows]

        def write(aside: Path) -> None:
            with aside.open("w", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, list(flat[0]))
                writer.writeheader()
                writer.writerows(flat)

        put(self.evaluations, write)


def _flat(row: dict[str, Any]) -> dict[str, Any]:
    """Give each figure of each lap a column, and pairs two, of shoulder and elbow or of the links."""
    flat: dict[str, Any] = {}
    for name, value in row.items():
        if isinstance(value, dict):
            flat |= {f"{name}_{figure}": number for figure, number in _flat(value).items()}
        elif name in ("torque_change", "peak_deflection", "peak_torque"):
            first, second = (None, None) if value is None else value
            flat[f"{name}_1"], flat[f"{name}_2"] = first, second
        else:
            flat[name] = value
    return flat


def write_checkpoint(path: Path, config: RunConfig, state: dict[str, Any]) -> None:
    """Write a checkpoint, which holds the configuration and a state; the file is complete or absent."""

    def write(aside: Path) -> None:
        with zipfile.ZipFile(aside, "w") as file:
            file.writestr(_CONFIG, json.dumps(config.plain()))
            file.writestr(_STATE, pickle.dumps(state))

    put(path, write)


def read_checkpoint(path: Path, config: RunConfig) -> dict[str, Any]:
    """Read the state in a checkpoint, which must be from a source that you trust: reading it can execute code.

    Raises:
        FileNotFoundError: if there is none.
        ValueError: if it is damaged, of another version, or of a training with another configuration.
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
