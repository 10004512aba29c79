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
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import NDArray

from flexarm_agents.board.summary import LIMIT, counted, loss, nominal_errors
from flexarm_agents.board.tables import millimetres, ranked, share
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
UNREAD = "0.85"  # of a bar
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
    """Draw, for each row and axis, how many laps are lost along the axis, and the mean error in which these count."""
    names = [name for name in board["columns"] if name != "nominal"]
    rows = ranked(board)
    figure, axis = plt.subplots(figsize=(2.6 + 1.15 * len(names), 2.0 + 0.45 * len(rows)))
    errors = np.full((len(rows), len(names)), np.nan)
    for i, row in enumerate(rows):
        for k, name in enumerate(names):
            errors[i, k], text = _along(row["columns"][name]["points"])
            dark = np.isfinite(errors[i, k]) and errors[i, k] > 0.3
            axis.text(k, i, text, ha="center", va="center", fontsize=8, color="white" if dark else "black")
    colours = plt.get_cmap("viridis_r").with_extremes(bad="0.92")
    drawn = axis.imshow(np.ma.masked_invalid(errors), cmap=colours, norm=LogNorm(0.01, LIMIT), aspect="auto")
    titles = [SHORT.get(name, board["columns"][name]["title"]) for name in names]
    axis.set_xticks(range(len(names)), titles, rotation=35, ha="right", fontsize=9)
    axis.set_yticks(range(len(rows)), [row["name"] + (" *" if row["privileged"] else "") for row in rows], fontsize=9)
    axis.grid(visible=False)
    axis.set_title(
        "Share of laps lost along the axis; mean error [mm], a lost lap counted as "
        f"{LIMIT:g} m (in brackets: of the completed laps alone). *: privileged",
        fontsize=9,
        loc="left",
    )
    bar = figure.colorbar(drawn, label=f"mean error along the axis, a lost lap counted as {LIMIT:g} m [m]")
    bar.ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    bar.ax.yaxis.set_major_formatter("{x:g}")
    bar.ax.yaxis.set_minor_formatter(NullFormatter())
    save(figure, folder, "heat_map")


def _along(points: Sequence[Mapping[str, Any] | None]) -> tuple[float, str]:
    """Return the mean error of all laps along an axis [m], and as text the share of lost ones, then the errors."""
    laps = [lap for point in points if point and "not_applicable" not in point for lap in point.values()]
    if not laps:
        return np.nan, "n/a"
    error, lost = counted(laps), loss(laps)
    if lost == 0.0:
        return error, millimetres(error)
    if lost == 1.0:
        return error, "all lost"
    whole = counted([lap | {"lost": 0, "episodes": lap["episodes"] - lap["lost"]} for lap in laps if lap["rms"]])
    return error, f"{share(lost)} lost\n{millimetres(error)} ({millimetres(whole)})"


def delays(board: Board, folder: Path) -> None:
    """Draw the delays with which each row holds, and with which its error is below twice the nominal one."""
    column = board["columns"]["delay"]
    longest = column["values"][-1]
    rows = ranked(board)[::-1]
    figure, axis = plt.subplots(figsize=(9.0, 1.8 + 0.32 * len(rows)))
    looks = (
        (("lost",), COLOURS[5], "no lap is lost"),
        (("lost", "doubled"), COLOURS[0], "error below twice the nominal one"),
    )
    for i, row in enumerate(rows):
        breaking = row["columns"]["delay"]["breaking"]
        if "late tip" not in row["reads"]:
            axis.barh(i, longest, color=UNREAD, height=0.6)
        elif any(one["complete"] is not None for one in breaking.values()):
            axis.text(column["nominal"] + 1.5, i, "lost at the nominal delay", va="center", fontsize=8, color="0.3")
        else:
            for worse, colour, _ in looks:
                low, high = _holds(breaking, worse, longest)
                axis.barh(i, high - low, left=low, color=colour, height=0.6)
        if row["delay_margin"] is not None:
            at = [1e3 * row["delay_margin"][end] for end in ("least", "most")]
            axis.plot(at, [i, i], color=COLOURS[1], marker="|", markersize=14, linewidth=2.0)
    for _, colour, label in looks:
        axis.barh(0, 0.0, color=colour, label=label)
    axis.barh(0, 0.0, color=UNREAD, label="does not read the sensor")
    axis.plot([], [], color=COLOURS[1], marker="|", markersize=12, linewidth=2.0, label="exact margin (linear loop)")
    axis.axvline(column["nominal"], color="0.3", linestyle=":", linewidth=1.2)
    axis.text(column["nominal"] + 0.5, len(rows) - 0.45, "nominal", fontsize=8, color="0.3")
    axis.set_yticks(range(len(rows)), [row["name"] + (" *" if row["privileged"] else "") for row in rows], fontsize=9)
    axis.set_xlabel(f"sensor delay [ms], measured up to {longest:g} ms; *: privileged")
    axis.set_xlim(0.0, longest + 4.0)
    axis.set_ylim(-0.6, len(rows) + 0.2)
    axis.legend(loc="upper center", bbox_to_anchor=(0.45, -0.1), ncols=2, fontsize=9)
    save(figure, folder, "delays")


def _holds(breaking: Mapping[str, Any], worse: Sequence[str], longest: float) -> tuple[float, float]:
    """Return the range about the nominal delay in which both laps hold.

    Args:
        breaking: see `flexarm_agents.board.summary.breaking`; the nominal laps are complete.
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
