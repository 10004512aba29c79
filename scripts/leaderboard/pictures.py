"""The board's pictures of its figures; those of its laps are in `scripts.docs.lap_pictures`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.colors import LogNorm

from flexarm_agents.board.columns import COLUMNS
from flexarm_agents.board.summary import LIMIT
from flexarm_agents.board.tables import UNLIMITED, amount, ranked
from scripts.common.plotting import COLOURS, INK, THRESHOLD, WIDTH, headline, number_ticks, save

Board = Mapping[str, Any]
SHORT = {"sensor_position": "Sensor position", "actuation_delay": "Motor delay", "jitter": "Delay jitter"}
SHORT |= {"pace": "Lap times", "pace_unknown": "Lap times, unknown plant"}
PACE = {"pace": "Nominal arm", "pace_unknown": "16 unknown arms"}  # columns of lap times
PACED = ("lqg", "lqg_adaptive", "nmpc_adaptive", "agent student_unknown", "shaped")  # entries that are drawn over them
LINE = 0.27  # height of an entry [in]


def draw(board: Board, folder: Path) -> None:
    """Draw every picture for which the board has the columns."""
    folder.mkdir(parents=True, exist_ok=True)
    if set(board["columns"]) > {"nominal"}:
        heat_map(board, folder)
    if set(PACE) <= set(board["columns"]):
        pace(board, folder)


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


def pace(board: Board, folder: Path) -> None:
    """Draw the error of the worse lap over the lap time, on nominal and unknown arms, and that of the best plans."""
    figure, axes = plt.subplots(1, len(PACE), figsize=(WIDTH, 3.8), sharey=True)
    shown = [row for name in PACED for row in board["rows"] if row["name"] == name]
    for axis, (name, title) in zip(axes, PACE.items(), strict=True):
        column = board["columns"][name]
        best = [[one["rms"] for one in board["tasks"][task]["best"].values()] for task in column["tasks"]]
        axis.plot(
            column["values"], 1e3 * np.max(best, axis=1), color=INK, linestyle="--", label="best plans known", zorder=3
        )
        for row, colour in zip(shown, COLOURS, strict=False):
            errors = [_worse(point) for point in row["columns"][name]["points"]]
            axis.plot(column["values"], errors, color=colour, marker="o", markersize=4, label=_name(row))
        axis.axhline(1e3 * (COLUMNS["pace"].bound or np.nan), **THRESHOLD)
        axis.set(title=title, xlabel="lap time [s]", yscale="log")
        number_ticks(axis.xaxis, column["values"])
    number_ticks(axes[0].yaxis, (20, 50, 100, 200, 500, 1000))
    axes[0].set_ylabel("error of the worse lap, r.m.s. [mm]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    save(figure, folder, "pace")


def _worse(point: Mapping[str, Any] | None) -> float:
    """Return the mean error of the worse lap [mm]; none where one is lost."""
    laps = {} if point is None or "not_applicable" in point else point
    errors = [np.nan if one["lost"] else 1e3 * one["rms"]["mean"] for one in laps.values()]
    return float(np.max(errors)) if errors else np.nan


def _along(whole: Mapping[str, Any] | None, name: str, about: Mapping[str, str]) -> tuple[float, str]:
    """Return how dark a column's cell is (as an error [m]), and the share of lost laps as text, else the figure."""
    if whole is None:
        return np.nan, "n/a"
    share, value = whole["lost"] / whole["episodes"], whole[name] and whole[name]["p90"]
    if whole["lost"]:
        error = value if value and about["unit"] == "m" else 0.0
        return max(LIMIT * share, error), f"{100.0 * share:.0f} %" if share >= 0.01 else "< 1 %"
    return value if about["unit"] == "m" else np.nan, amount(value, about["unit"])
