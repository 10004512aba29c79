"""The board's pictures of its figures; those of its laps are in `scripts.docs.lap_pictures`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt

from flexarm_agents.board.columns import COLUMNS
from flexarm_agents.board.tables import SHORT, on_square
from scripts.common.plotting import COLOURS, INK, THRESHOLD, WIDTH, headline, number_ticks, save

Board = Mapping[str, Any]
TITLES = {"sensor_position": "Sensor position", "actuation_delay": "Motor delay", "jitter": "Delay jitter"}
TITLES |= {"pace": "Lap times", "pace_unknown": "Unknown, lap times"}
PACE = {"pace": "Nominal arm", "pace_unknown": "16 unknown arms"}  # columns of lap times
DRAWN = dict(zip(SHORT, COLOURS, strict=False))  # colours of the entries that are told apart
OTHERS = {"color": "0.78", "linewidth": 1.0, "marker": "o", "markersize": 3}
ERRORS = (5, 10, 20, 50, 100, 200, 500, 1000, 2000)  # ticks [mm]
INFINITE = 8000.0  # where an infinite error is drawn [mm]


def draw(board: Board, folder: Path) -> None:
    """Draw every picture for which the board has the columns."""
    folder.mkdir(parents=True, exist_ok=True)
    if len(names := compared(board)) > 1:
        columns(names, board, folder)
    if set(PACE) <= set(board["columns"]):
        pace(board, folder)


def compared(board: Board) -> list[str]:
    """Return the names of the columns of errors, without the nominal one, that an entry of the square has whole."""
    rows = [row["columns"] for row in board["rows"] if on_square(row)]
    figures = {name: board["tasks"][column["tasks"][0]]["figures"] for name, column in board["columns"].items()}
    names = [name for name in figures if "rms" in figures[name] and name != "nominal"]
    return [name for name in names if any("whole" in row[name] for row in rows)]


def _look(row: Mapping[str, Any]) -> dict[str, Any]:
    """Return how the line of an entry with a colour looks, with its name."""
    name = row["name"]
    return {"color": DRAWN[name], "marker": "o", "markersize": 4, "zorder": 3, "label": name.removeprefix("agent ")}


def columns(names: Sequence[str], board: Board, folder: Path) -> None:
    """Draw, over columns, the share of laps that each entry loses, and the 90th percentile of its error."""
    figure, axes = plt.subplots(2, 1, figsize=(WIDTH, 8.0), sharex=True, height_ratios=(2, 3))
    for row in filter(on_square, board["rows"]):
        wholes = [row["columns"][name].get("whole") for name in names]
        shares = [np.nan if one is None else 100.0 * one["lost"] / one["episodes"] for one in wholes]
        for axis, values in zip(axes, (shares, [_percentile(one) for one in wholes]), strict=True):
            axis.plot(values, **(_look(row) if row["name"] in DRAWN else OTHERS))
    axes[0].plot([], label="all others", **OTHERS)
    axes[0].set(ylabel="laps lost [%]", yticks=range(0, 101, 20))
    axes[1].set(ylabel="90th percentile of the error [mm]", yscale="log")
    axes[1].set_yticks([*ERRORS, INFINITE], [*map(str, ERRORS), "infinite"])
    axes[1].set_yticks([], minor=True)
    titles = [TITLES.get(name, board["columns"][name]["title"]) for name in names]
    axes[1].set_xticks(range(len(names)), titles, rotation=40, ha="right", rotation_mode="anchor")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    headline(figure, "Every column: all its laps together; a lost lap has an infinite error")
    save(figure, folder, "columns")


def _percentile(whole: Mapping[str, Any] | None) -> float:
    """Return the 90th percentile of a column's errors [mm]; none where it is not applicable or not measured."""
    if whole is None:
        return np.nan
    found = whole["rms"] and whole["rms"]["p90"]
    return INFINITE if found is None else 1e3 * float(found)


def pace(board: Board, folder: Path) -> None:
    """Draw the error of the worse lap over the lap time, on nominal and unknown arms, and that of the best plans."""
    figure, axes = plt.subplots(1, len(PACE), figsize=(WIDTH, 3.8), sharey=True)
    for axis, (name, title) in zip(axes, PACE.items(), strict=True):
        column = board["columns"][name]
        best = [[one["rms"] for one in board["tasks"][task]["best"].values()] for task in column["tasks"]]
        plans = 1e3 * np.max(best, axis=1)
        axis.plot(column["values"], plans, color=INK, linestyle="--", label="best plans known", zorder=4)
        for row in board["rows"]:
            errors = [_worse(point) for point in row["columns"][name]["points"]]
            if row["name"] in DRAWN and np.isfinite(errors).any():
                axis.plot(column["values"], errors, **_look(row))
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
