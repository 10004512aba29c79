"""The board's pictures of its figures; those of its laps are in `scripts.docs.lap_pictures`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.colors import LogNorm

from flexarm_agents.board.summary import LIMIT
from flexarm_agents.board.tables import UNLIMITED, amount, ranked
from scripts.common.plotting import WIDTH, headline, save

Board = Mapping[str, Any]
SHORT = {"sensor_position": "Sensor position", "actuation_delay": "Motor delay", "jitter": "Delay jitter"}
SHORT |= {"pace": "Lap times", "pace_unknown": "Lap times, unknown plant"}
LINE = 0.27  # height of an entry [in]


def draw(board: Board, folder: Path) -> None:
    """Draw every picture for which the board has the columns."""
    folder.mkdir(parents=True, exist_ok=True)
    if set(board["columns"]) > {"nominal"}:
        heat_map(board, folder)


def _name(row: Mapping[str, Any]) -> str:
    """Return a row's name, marked if it has no rank."""
    marks = " *" * row["privileged"] + f" {UNLIMITED}" * (row["torque_limit"] is None)
    return f"{row['name'].removeprefix('agent ')}{marks}"


def _of(row: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    """Return what a row has in a column."""
    return row["columns"].get(name, {})


def heat_map(board: Board, folder: Path) -> None:
    """Draw, for each row and column, the share of laps that are lost, or the error's 90th percentile if none is."""
    rows = ranked(board)
    axes = [name for name in board["columns"] if name != "nominal"]
    names = [name for name in axes if any("whole" in _of(row, name) for row in rows)] or axes
    figure, axis = plt.subplots(figsize=(WIDTH, 1.9 + LINE * len(rows)))
    errors = np.full((len(rows), len(names)), np.nan)
    for i, row in enumerate(rows):
        for k, name in enumerate(names):
            figures = board["tasks"][board["columns"][name]["tasks"][0]]["figures"]
            errors[i, k], text = _along(_of(row, name).get("whole"), *next(iter(figures.items())))
            dark, lost = errors[i, k] > 0.3, text.endswith("%")
            look: dict[str, Any] = {"color": "white" if dark else "black", "weight": "bold" if lost else "normal"}
            axis.text(k, i, text, ha="center", va="center", size=10, **look)
    colours = plt.get_cmap("cividis_r").with_extremes(bad="0.92")
    axis.imshow(np.ma.masked_invalid(errors), cmap=colours, norm=LogNorm(0.03, LIMIT), aspect="auto")
    titles = [SHORT.get(name, board["columns"][name]["title"]) for name in names]
    axis.set_xticks(range(len(names)), titles, rotation=40, ha="right", rotation_mode="anchor")
    axis.set_yticks(range(len(rows)), [_name(row) for row in rows])
    axis.grid(visible=False)
    headline(
        figure,
        "Share of laps lost [%], or 90th percentile of the error [mm] if none is lost\n"
        f"First in the ranking first; darker is worse; *: reads the true state; {UNLIMITED}: no limit of torque",
    )
    save(figure, folder, "heat_map")


def _along(whole: Mapping[str, Any] | None, name: str, about: Mapping[str, str]) -> tuple[float, str]:
    """Return how dark a column's cell is (as an error [m]), and the share of lost laps as text, else the figure."""
    if whole is None:
        return np.nan, "n/a"
    share, value = whole["lost"] / whole["episodes"], whole[name] and whole[name]["p90"]
    if whole["lost"]:
        error = value if value and about["unit"] == "m" else 0.0
        return max(LIMIT * share, error), f"{100.0 * share:.0f} %" if share >= 0.01 else "< 1 %"
    return value if about["unit"] == "m" else np.nan, amount(value, about["unit"])
