"""The board's pictures of its figures; those of its laps are in `scripts.docs.lap_pictures`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.colors import LogNorm

from flexarm_agents.board.summary import LIMIT, counted, loss, within
from flexarm_agents.board.tables import ranked
from scripts.common.plotting import BLUE, COLOURS, ORANGE, SOFT, WIDTH, headline, save

Board = Mapping[str, Any]
SHORT = {"sensor_position": "Sensor position", "actuation_delay": "Motor delay", "jitter": "Delay jitter"}
LINE = 0.27  # height of an entry [in]


def draw(board: Board, folder: Path) -> None:
    """Draw every picture for which the board has the columns."""
    folder.mkdir(parents=True, exist_ok=True)
    if set(board["columns"]) > {"nominal"}:
        heat_map(board, folder)
    if {"nominal", "delay"} <= set(board["columns"]):
        delays(board, folder)


def _name(row: Mapping[str, Any]) -> str:
    """Return a row's name, marked if it reads the true state."""
    return row["name"].removeprefix("agent ") + (" *" if row["privileged"] else "")


def heat_map(board: Board, folder: Path) -> None:
    """Draw, for each row and axis, the share of laps that are lost along the axis, or the mean error if none is."""
    names = [name for name in board["columns"] if name != "nominal"]
    rows = ranked(board)
    figure, axis = plt.subplots(figsize=(WIDTH, 1.9 + LINE * len(rows)))
    errors = np.full((len(rows), len(names)), np.nan)
    for i, row in enumerate(rows):
        for k, name in enumerate(names):
            errors[i, k], text = _along(row["columns"][name]["points"])
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
        "Along each axis: share of laps lost [%], or mean error [mm] if none is lost\n"
        "Best entry on unknown arms first; darker is worse; *: reads the true state",
    )
    save(figure, folder, "heat_map")


def _along(points: Sequence[Mapping[str, Any] | None]) -> tuple[float, str]:
    """Return the mean error of all laps along an axis [m], and as text the share of lost ones, else the error [mm]."""
    laps = [lap for point in points if point and "not_applicable" not in point for lap in point.values()]
    if not laps:
        return np.nan, "n/a"
    error, lost = counted(laps), 100.0 * loss(laps)
    if lost:
        return error, f"{lost:.0f} %" if lost >= 1.0 else "< 1 %"
    return error, f"{1e3 * error:.0f}"


def delays(board: Board, folder: Path) -> None:
    """Draw the delays with which each row that reads the late sensor holds, and those that do not double its error."""
    column = board["columns"]["delay"]
    longest = column["values"][-1]
    rows = [row for row in ranked(board)[::-1] if "late tip" in row["reads"]]
    figure, axis = plt.subplots(figsize=(WIDTH, 1.2 + LINE * len(rows)))
    for i, row in enumerate(rows):
        breaking = row["columns"]["delay"]["breaking"]
        if any(one["complete"] is not None for one in breaking.values()):
            axis.text(1.0, i, f"lost at {column['nominal']:.0f} ms", va="center", color=SOFT)
        else:
            for worse, colour in ((("lost",), COLOURS[5]), (("lost", "doubled"), BLUE)):
                inside = within(column["values"], [one[what] for one in breaking.values() for what in worse])
                axis.barh(i, inside[-1] - inside[0], left=inside[0], color=colour, height=0.66)
        if row["delay_margin"] is not None and 1e3 * row["delay_margin"]["least"] > 1.0:
            at = [1e3 * row["delay_margin"][end] for end in ("least", "most")]
            axis.plot(at, [i, i], color=ORANGE, linewidth=4.0)
            axis.annotate("margin by\nlinear theory", (at[1], i), (6, 0), textcoords="offset points", color=ORANGE)
    axis.axvline(column["nominal"], color="white", linewidth=1.5)
    axis.annotate(
        f"default, {column['nominal']:.0f} ms",
        (column["nominal"], 1.0),
        (0, 2),
        ("data", "axes fraction"),
        textcoords="offset points",
        ha="center",
        color=SOFT,
    )
    axis.set_yticks(range(len(rows)), [_name(row) for row in rows])
    axis.set_xlabel(f"delay of the sensor at the tip [ms], measured up to {longest:g} ms")
    axis.set_xlim(0.0, 1.17 * longest)
    axis.set_xticks(np.arange(0.0, longest + 1.0, 20.0))
    axis.set_ylim(-0.6, len(rows) - 0.4)
    headline(figure, "Dark: the error is below twice that at the default delay; light: no lap is lost")
    save(figure, folder, "delays")
