"""The board's pictures."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.patches import Rectangle
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import NDArray

from flexarm_agents.board.summary import nominal_errors
from flexarm_agents.board.tables import ranked
from flexarm_baselines.optimal.plan import PLANS
from flexarm_env.laps import LAPS, SETTLED
from flexarm_env.metrics import ended_early
from flexarm_env.simulation.trajectory import Trajectory
from scripts.common.plotting import COLOURS, save
from scripts.leaderboard.runs import Runs

Array = NDArray[np.float64]
Board = Mapping[str, Any]
SHOWN = ("ifdc", "agent square", "agent student_unknown", "lqg", "lqg_adaptive")  # where there is room for few
SHORT = {"sensor_position": "Sensor position"}  # headings where there is little room
MARKS = "osD^vP*X<>ph8"


def draw(board: Board, runs: Runs, folder: Path) -> None:
    """Draw every picture for which the board has the columns."""
    folder.mkdir(parents=True, exist_ok=True)
    few = {name: runs[name] for name in SHOWN if name in runs}
    if few:
        corners(few, folder)
        errors(few, folder)
    if "nominal" in board["columns"]:
        effort(board, runs, folder)
        heat_map(board, folder)
    if {"nominal", "delay"} <= set(board["columns"]):
        delays(board, folder)


def corners(runs: Runs, folder: Path) -> None:
    """Draw the tip's paths where the reference begins or turns."""
    places = [
        ("swing", 0.0, "start of the swing lap"),
        ("plain", 0.0, "start of the plain lap"),
        ("plain", 4.0, "first corner, plain lap"),
        ("plain", 8.0, "second corner, plain lap"),
    ]
    figure, axes = plt.subplots(1, len(places), figsize=(15.0, 4.6))
    for axis, (lap, time, title) in zip(axes, places, strict=True):
        for colour, (name, laps) in zip(COLOURS, runs.items(), strict=False):
            run = laps[lap]
            near = np.abs(run.time - time) <= 1.0
            axis.plot(*run.tip[near].T, color=colour, label=name, linewidth=1.4, linestyle=_style(name))
        _reference(axis, next(iter(runs.values()))[lap], time)
        axis.set_title(title)
        axis.set_xlabel("x [m]")
    axes[0].set_ylabel("y [m]")
    axes[0].legend(loc="lower right", fontsize=9)
    save(figure, folder, "corners")


def _style(name: str) -> str:
    """Dash the yardstick's line, below which others may lie."""
    return ":" if name == SHOWN[-1] else "-"


def _reference(axis: Axes, run: Trajectory, time: float) -> None:
    assert run.reference is not None
    at = run.reference[np.argmin(np.abs(run.time - time))]
    axis.plot(*run.reference[np.abs(run.time - time) <= 1.0].T, color="0.2", linestyle="--", linewidth=1.0, zorder=0)
    axis.set_aspect("equal")
    axis.set_xlim(at[0] - 1.3, at[0] + 1.3)
    axis.set_ylim(at[1] - 1.3, at[1] + 1.3)


def errors(runs: Runs, folder: Path) -> None:
    """Draw the tip's distance from the reference against time."""
    figure, axes = plt.subplots(len(LAPS), 1, figsize=(10.0, 6.5), sharex=True)
    for axis, lap in zip(axes, LAPS, strict=True):
        for colour, (name, laps) in zip(COLOURS, runs.items(), strict=False):
            run = laps[lap]
            assert run.reference is not None
            away = np.linalg.norm(run.tip - run.reference, axis=1)
            axis.semilogy(
                run.time, np.maximum(away, 1e-4), color=colour, label=name, linewidth=1.2, linestyle=_style(name)
            )
            if ended_early(run):
                axis.plot(run.time[-1], away[-1], marker="X", color=colour)
        axis.axvline(SETTLED, color="0.6", linewidth=0.8)
        axis.set_ylabel(f"{lap} lap: error [m]")
        axis.set_ylim(1e-4, 5.0)
    axes[-1].set_xlabel("time [s]")
    axes[0].legend(ncols=3, loc="lower right", fontsize=9)
    save(figure, folder, "errors")


def heat_map(board: Board, folder: Path) -> None:
    """Draw, for each row and axis, the largest mean error along the axis, and the share of points with a lost lap."""
    names = [name for name in board["columns"] if name != "nominal"]
    rows = ranked(board)
    figure, axis = plt.subplots(figsize=(2.6 + 1.05 * len(names), 1.6 + 0.42 * len(rows)))
    colours = plt.get_cmap("viridis_r").with_extremes(bad="0.92")
    largest, texts = np.full((len(rows), len(names)), np.nan), {}
    for i, row in enumerate(rows):
        for k, name in enumerate(names):
            largest[i, k], texts[i, k] = _worst(row["columns"][name]["points"])
    some_lost = [place for place, text in texts.items() if "lost" in text]
    drawn = axis.imshow(np.ma.masked_invalid(largest), cmap=colours, norm=LogNorm(0.01, 3.0), aspect="auto")
    for i, k in some_lost:
        look: dict[str, Any] = {"fill": False, "hatch": "//", "edgecolor": "0.45", "linewidth": 0.0}
        axis.add_patch(Rectangle((k - 0.5, i - 0.5), 1.0, 1.0, **look))
    for (i, k), text in texts.items():
        dark = np.isfinite(largest[i, k]) and largest[i, k] > 0.3
        colour = "white" if dark else "black"
        back = None
        if (i, k) in some_lost:
            back = {"facecolor": colours(drawn.norm(largest[i, k])), "edgecolor": "none", "pad": 1.0}
        axis.text(k, i, text, ha="center", va="center", fontsize=8, color=colour, bbox=back)
    titles = [SHORT.get(name, board["columns"][name]["title"]) for name in names]
    axis.set_xticks(range(len(names)), titles, rotation=35, ha="right", fontsize=9)
    axis.set_yticks(range(len(rows)), [row["name"] + (" *" if row["privileged"] else "") for row in rows], fontsize=9)
    axis.grid(visible=False)
    figure.colorbar(drawn, label="largest mean error along the axis [m]")
    save(figure, folder, "heat_map")


def _worst(points: Sequence[Mapping[str, Any] | None]) -> tuple[float, str]:
    """Return the largest mean error of any point and lap [m], and it as text with the share of lost episodes."""
    laps = [lap for point in points if point and "not_applicable" not in point for lap in point.values()]
    if not laps:
        return np.nan, "n/a"
    lost = sum(lap["lost"] for lap in laps) / sum(lap["episodes"] for lap in laps)
    means = [lap["rms"]["mean"] for lap in laps if lap["rms"] is not None]
    if not means:
        return np.nan, "all lost"
    share = f"\n{100.0 * lost:.0f} % lost" if lost else ""
    return max(means), f"{max(means):.2f}{share}"


def delays(board: Board, folder: Path) -> None:
    """Draw the delays with which each row holds, and with which its error is below twice the nominal one."""
    column = board["columns"]["delay"]
    longest = column["values"][-1]
    rows = ranked(board)[::-1]
    figure, axis = plt.subplots(figsize=(9.0, 1.4 + 0.4 * len(rows)))
    looks = (
        (("lost",), COLOURS[5], "no lap is lost"),
        (("lost", "doubled"), COLOURS[0], "error below twice the nominal one"),
    )
    for i, row in enumerate(rows):
        for worse, colour, label in looks:
            low, high = _holds(row["columns"]["delay"]["breaking"], worse, longest)
            axis.barh(i, high - low, left=low, color=colour, height=0.6, label=None if i else label)
            if "doubled" not in worse and high == longest:
                axis.text(longest + 1.0, i, "…", va="center")
        if row["delay_margin"] is not None:
            at = [1e3 * row["delay_margin"][end] for end in ("least", "most")]
            axis.plot(at, [i, i], color=COLOURS[1], marker="|", markersize=14, linewidth=2.0)
    axis.plot([], [], color=COLOURS[1], marker="|", markersize=12, label="exact margin of the linear loop")
    axis.axvline(column["nominal"], color="0.3", linestyle=":", linewidth=1.2)
    axis.text(column["nominal"] + 0.5, len(rows) - 0.4, "nominal", fontsize=8, color="0.3")
    axis.set_yticks(range(len(rows)), [row["name"] for row in rows])
    axis.set_xlabel("sensor delay [ms]")
    axis.set_xlim(0.0, longest + 6.0)
    axis.legend(loc="upper center", bbox_to_anchor=(0.5, -0.18), ncols=3, fontsize=9)
    save(figure, folder, "delays")


def _holds(breaking: Mapping[str, Any], worse: Sequence[str], longest: float) -> tuple[float, float]:
    """Return the range about the nominal delay in which both laps hold.

    Args:
        breaking: see `flexarm_agents.board.summary.breaking`.
        worse: "lost", "doubled" or both: what must not happen.
        longest: of the axis.
    """
    ends = [one[what] for one in breaking.values() for what in worse]
    low = max((end["low"] for end in ends if end["low"] is not None), default=0.0)
    return low, min((end["high"] for end in ends if end["high"] is not None), default=longest)


def effort(board: Board, runs: Runs, folder: Path) -> None:
    """Draw error against effort on both laps, with the best plans known for a range of weights on effort."""
    figure, axes = plt.subplots(1, len(LAPS), figsize=(12.0, 5.0), sharey=True)
    rows = [row for row in ranked(board) if row["name"] in runs]
    for axis, lap in zip(axes, LAPS, strict=True):
        for n, row in enumerate(rows):
            error, run = nominal_errors(row)[lap], runs[row["name"]][lap]
            if error is not None:
                change = float(np.linalg.norm(np.sqrt(np.mean(np.diff(run.torque, axis=0) ** 2, axis=0))))
                look = {"color": COLOURS[n % len(COLOURS)], "marker": MARKS[n % len(MARKS)]}
                axis.loglog(change, error["rms"], linestyle="", markersize=8, label=row["name"], **look)
        plan = json.loads((PLANS / f"default_{lap}.json").read_text())
        curve = plan.get("pareto") or [plan["score"]]
        x = [float(np.linalg.norm(one["torque_change_rms"])) for one in curve]
        y = [one["true_tip_rms"] for one in curve]
        axis.loglog(x, y, color="0.2", marker=".", linewidth=1.2, label="best plans known")
        axis.set_title(f"{lap} lap")
        for one in (axis.xaxis, axis.yaxis):
            one.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            one.set_major_formatter("{x:g}")
            one.set_minor_formatter(NullFormatter())
        axis.set_xlabel("change of the torques from period to period, r.m.s. [N m]")
    axes[0].set_ylabel("error over the lap, r.m.s. [m]")
    axes[-1].legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=9)
    save(figure, folder, "effort")
