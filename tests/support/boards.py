"""Small boards: few periods of plain Python, and the files that a study leaves."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from flexarm_agents.board.columns import Point

SHORT = {"lap_time": 0.4, "side": 1.0, "control_period": 0.05}
SMALL = {"modes_per_link": 1, "kinematics": "linear"}


def points(values: list[float], seeds: range = range(1)) -> list[Point]:
    """Return points of an axis of sensor noise [mm]."""
    return [Point(x, {**SHORT, "noise": 0.001 * x}, SMALL, seeds=seeds) for x in values]


def files(folder: Path) -> dict[str, bytes]:
    """Return the contents of the whole JSON files below a folder, by their paths in it."""
    whole = [path for path in folder.rglob("*.json") if not path.name.startswith(".")]
    return {str(path.relative_to(folder)): path.read_bytes() for path in whole}


def leaves(value: Any, place: str = "") -> Iterator[tuple[str, Any]]:
    """Yield what is in nested mappings and lists, with its place."""
    if isinstance(value, dict | list | tuple):
        for key, part in value.items() if isinstance(value, dict) else enumerate(value):
            yield from leaves(part, f"{place}/{key}")
    else:
        yield place, value
