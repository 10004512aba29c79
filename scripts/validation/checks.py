"""What a check is, what a group of checks finds, and how both lie in files.

A group is a module with ``run(settings) -> Findings``, perhaps with ``tables(findings)`` for the docs, and a module
with ``draw(result, folder)``, which makes its pictures from the files that `write` left. `groups` lists them, `runner`
runs them.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from scripts.common.result_files import write_json

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Check:
    """One figure against its threshold.

    Attributes:
        group: name of the group.
        name: what is compared, a few words; unique in its group.
        figure: what was found.
        reason: why the threshold is what it is, one sentence.
        unit: unit of figure and threshold; "" for none.
        least: smallest figure that passes, None for no such bound.
        most: largest figure that passes, None for no such bound.
    """

    group: str
    name: str
    figure: float
    reason: str
    unit: str = ""
    least: float | None = None
    most: float | None = None

    def __post_init__(self) -> None:
        """Bring numbers to floats and ask for a bound and a reason.

        Raises:
            ValueError: for a check without bound or reason.
        """
        for name in ("figure", "least", "most"):
            value = getattr(self, name)
            object.__setattr__(self, name, None if value is None else float(value))
        if self.least is None and self.most is None:
            raise ValueError(f"check {self.name!r}: must have a bound, least or most")
        if not self.reason:
            raise ValueError(f"check {self.name!r}: must say why its threshold is what it is")

    @property
    def passed(self) -> bool:
        """Whether the figure is finite and within its bounds."""
        above = self.least is None or self.figure >= self.least
        below = self.most is None or self.figure <= self.most
        return math.isfinite(self.figure) and above and below

    @property
    def threshold(self) -> str:
        """The bounds as text."""
        if self.least is None:
            return f"<= {shown(self.most)}{self._unit}"
        if self.most is None:
            return f">= {shown(self.least)}{self._unit}"
        return f"{shown(self.least)} to {shown(self.most)}{self._unit}"

    @property
    def found(self) -> str:
        """The figure as text."""
        return f"{shown(self.figure)}{self._unit}"

    @property
    def _unit(self) -> str:
        return f" {self.unit}" if self.unit else ""


def shown(value: float | None) -> str:
    """Write a number with three digits."""
    return "none" if value is None else f"{value:.3g}"


@dataclass(frozen=True)
class Settings:
    """How a group is to run.

    Attributes:
        quick: the short version, seconds a group.
        progress: called with a few words before each part of the work.
    """

    quick: bool = False
    progress: Callable[[str], None] = field(default=lambda _: None, compare=False)


@dataclass(frozen=True)
class Findings:
    """What a group found.

    Attributes:
        checks: in the order of the table.
        arrays: data of the pictures.
        records: further plain data of pictures and tables (what JSON holds).
        quoted: figures, beside those of the checks, that the text of docs/validation.md quotes.
    """

    checks: Sequence[Check]
    arrays: Mapping[str, Array] = field(default_factory=dict)
    records: Mapping[str, Any] = field(default_factory=dict)
    quoted: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Result:
    """A group's findings as its files hold them.

    Attributes:
        key: settings and sources that it was made with (`runner.key`).
        seconds: what it took.
        findings: checks and data.
    """

    key: str
    seconds: float
    findings: Findings


def write(folder: Path, result: Result) -> None:
    """Write ``result.json`` and ``data.npz``; the JSON last, and complete or absent."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "result.json").unlink(missing_ok=True)
    arrays: dict[str, Any] = {name: np.asarray(array) for name, array in result.findings.arrays.items()}
    np.savez(folder / "data.npz", **arrays)
    data = {
        "key": result.key,
        "seconds": result.seconds,
        "checks": [asdict(check) for check in result.findings.checks],
        "records": result.findings.records,
        "quoted": result.findings.quoted,
    }
    write_json(folder / "result.json", data)


def read(folder: Path) -> Result | None:
    """Read what `write` wrote; None if it is incomplete or of another version."""
    try:
        data = json.loads((folder / "result.json").read_text())
        with np.load(folder / "data.npz") as file:
            arrays = {name: file[name] for name in file.files}
        checks = [check_of(values) for values in data["checks"]]
        return Result(data["key"], data["seconds"], Findings(checks, arrays, data["records"], data["quoted"]))
    except (OSError, ValueError, KeyError, TypeError, BadZipFile):
        return None


def check_of(values: Mapping[str, Any]) -> Check:
    """Read a check from JSON, where what is not finite is null."""
    return Check(**{**values, "figure": math.nan if values["figure"] is None else values["figure"]})
