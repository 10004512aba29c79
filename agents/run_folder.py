"""`RunFolder`: what lies where in the folder of a training, written so that files are complete or absent."""

from __future__ import annotations

import csv
import json
import os
import secrets
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, TypeVar

from flexarm_agents.config import RunConfig
from flexarm_env.validation import short

_FORMAT = 1
_UNFINISHED = ".new-"
_FORGOTTEN = 86400.0  # age of an unfinished file that nobody writes any more [s]
Config = TypeVar("Config", bound=RunConfig)


class RunFolder:
    """A training's folder.

    Attributes:
        path: path of the folder.
        config: `config.json`, the configuration.
        versions: `versions.json`, of Python, the libraries and the code that began the training.
        evaluations: `evaluations.csv`, a row for each evaluation, with the worst of its laps of either kind;
            `evaluations.json` holds the same.
        best: `best_policy.npz`, the policy of the best evaluation, for `load_policy`.
        best_model: `best_model.zip`, the same as a stable-baselines3 model.
        last: `last_policy.npz`, the policy at the end.
        initial: `initial_policy.npz`, the policy whose network the training began with, if there is one.
        checkpoint: `checkpoint.zip`, from which the training resumes.
        logs: `tensorboard/`.
    """

    def __init__(self, path: str | Path) -> None:
        """Name the files; nothing is read or written.

        Args:
            path: path of the folder.
        """
        self.path = Path(path)
        self.config, self.evaluations = self.path / "config.json", self.path / "evaluations.csv"
        self.best, self.best_model = self.path / "best_policy.npz", self.path / "best_model.zip"
        self.last, self.checkpoint = self.path / "last_policy.npz", self.path / "checkpoint.zip"
        self.initial = self.path / "initial_policy.npz"
        self.logs, self.versions = self.path / "tensorboard", self.path / "versions.json"

    def begin(self, config: RunConfig, versions: Mapping[str, str]) -> None:
        """Make the folder for a new training.

        Args:
            config: the configuration.
            versions: see the class.

        Raises:
            FileExistsError: if there is something already.
        """
        if self.path.exists() and (
            not self.path.is_dir() or any(not _is_unfinished(one) for one in self.path.iterdir())
        ):
            raise FileExistsError(
                f"folder = {self.path}: exists and is not empty; resume that training, remove it, or name another"
            )
        self.path.mkdir(parents=True, exist_ok=True)
        write_json(self.config, {"format": _FORMAT, **config.plain()})
        write_json(self.versions, dict(versions))

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
        """Begin a training in the folder, or check that the one in it may go on.

        Args:
            config: its configuration.
            versions: see `begin`.
            resume: go on.

        Raises:
            FileExistsError: see `begin`.
            FileNotFoundError, ValueError: see `read_config`, and if it has another configuration.
        """
        if resume:
            config.check_same(self.read_config(type(config)), self.path)
        else:
            with self.named():
                self.begin(config, versions)

    def read_config(self, kind: type[Config]) -> Config:
        """Read the configuration of the training in the folder.

        Args:
            kind: class of the configuration.

        Raises:
            FileNotFoundError: if there is no training.
            ValueError: if its configuration cannot be read.
        """
        if not self.config.is_file():
            raise FileNotFoundError(f"folder = {self.path}: holds no {self.config.name}, so there is no training in it")
        try:
            values = json.loads(self.config.read_text())
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
            with aside.open("w", newline="") as file:
                writer = csv.DictWriter(file, list(flat[0]))
                writer.writeheader()
                writer.writerows(flat)

        put(self.evaluations, write)


def put(path: Path, write: Callable[[Path], Any]) -> None:
    """Have a file written beside its place and put it there when it is complete; after an error nothing is left.

    Processes that write the same file do not meet: each writes aside under a name of its own, and the last one stays.
    What killed processes left aside is removed when it is a day old: nobody is still writing it.

    Args:
        path: path of the file; it keeps its ending while it is written.
        write: writes to the path it is given.
    """
    _sweep(path)
    aside = path.with_name(f"{_UNFINISHED}{secrets.token_hex(4)}-{path.name}")
    try:
        write(aside)
        os.replace(aside, path)
    finally:
        aside.unlink(missing_ok=True)


def _sweep(path: Path) -> None:
    """Remove what killed processes left of a file that they wrote."""
    for other in path.parent.glob(f"{_UNFINISHED}*"):
        if other.name.endswith(f"-{path.name}"):
            with suppress(FileNotFoundError):  # it was finished meanwhile, or removed by another process
                if time.time() - other.stat().st_mtime > _FORGOTTEN:
                    other.unlink()


def check_place(name: str, path: Path) -> None:
    """Check that a file can be put at a path; its folder is made.

    Args:
        name: of the parameter that has the path.
        path: of the file; one that is there may be replaced.

    Raises:
        OSError: if there can be no such file.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    if path.is_dir():
        raise IsADirectoryError(f"{name} = {path}: is a folder; must be a file")
    if not os.access(path.parent, os.W_OK):
        raise PermissionError(f"{name} = {path}: must be in a folder that may be written to")


def _is_unfinished(path: Path) -> bool:
    """Whether a file is what a killed process left of one that it wrote."""
    return path.name.startswith(_UNFINISHED)


def write_json(path: Path, values: Any, levels: int | None = None) -> None:
    """Write strict JSON; see `json_text`. The file is complete or absent."""
    text = json_text(values, levels)
    put(path, lambda aside: aside.write_text(text))


def json_text(values: Any, levels: int | None = None) -> str:
    """Write strict JSON.

    Args:
        values: plain values.
        levels: levels of nesting whose items have lines of their own; None: all.
    """
    return (json.dumps(values, indent=1, allow_nan=False) if levels is None else _lines(values, levels)) + "\n"


def _lines(value: Any, levels: int, margin: str = "") -> str:
    """Write JSON with a line for each item of the outer levels."""
    if not levels or not isinstance(value, dict | list) or not value:
        return json.dumps(value, allow_nan=False)
    inner = margin + " "
    if isinstance(value, list):
        items = [_lines(one, levels - 1, inner) for one in value]
    else:
        items = [f"{json.dumps(name)}: {_lines(one, levels - 1, inner)}" for name, one in value.items()]
    ends = "[]" if isinstance(value, list) else "{}"
    return ends[0] + ",".join(f"\n{inner}{item}" for item in items) + f"\n{margin}{ends[1]}"


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
