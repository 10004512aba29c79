"""Pictures of the analysis, drawn from its results: PNG for reading, SVG for print."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from scripts.analysis.margins import DELAYED, GAINS, SENSORS
from scripts.common.plotting import plt, save

COLORS = {"IFDC": "#111111", "FLSAC, largest": "#D55E00", "FLSAC, smallest": "#0072B2"}
RIGHT, AXIS, QUADRUPLE, EXACT = "#D55E00", "#0072B2", "#009E73", "0.6"
LABELS = {"position": "position late", "position+rate": "position and rate late"}


def zeros_locus(folder: Path, locus: dict[str, Any]) -> None:
    """Magnitude of every zero against the sensor's position, a panel for each number of modes."""
    models = [name for name in locus if name not in ("positions", "exact beam")]
    s = np.array(locus["positions"])
    figure, axes = plt.subplots(1, len(models), figsize=(13.5, 5.2), sharey=True)
    for axis, name in zip(axes, models, strict=True):
        for kind in ("real", "imaginary"):
            points = [(at, z) for at, row in zip(s, locus["exact beam"], strict=True) for z in row[kind]]
            axis.plot(*np.array(points).T, "o", color=EXACT, markersize=1.6, zorder=1)
        for right, on_axis, color, label in (
            (True, False, RIGHT, "right half plane, real (and its mirror image)"),
            (False, True, AXIS, "imaginary axis"),
            (True, True, QUADRUPLE, "right half plane, complex"),
        ):
            points = [
                (at, abs(complex(*z)))
                for at, row in zip(s, locus[name], strict=True)
                for z in row
                if (z[0] > 1e-6 * abs(complex(*z))) == right and (abs(z[1]) > 1e-6 * abs(complex(*z))) == on_axis
            ]
            if points:
                axis.plot(*np.array(points).T, "o", color=color, markersize=2.6, label=label, zorder=3)
        axis.plot([], [], "o", color=EXACT, markersize=3, label="exact beam (link 2)")
        axis.axvline(2.25, color="0.8", linewidth=1, zorder=0)
        axis.set(title=name, xlabel="sensor position s on link 2 [m]", yscale="log", ylim=(10, 1000), xlim=(0, 4.6))
    axes[0].set_ylabel("magnitude of the zero [rad/s]")
    handles: dict[str, Any] = {}
    for axis in axes:
        handles |= dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4, markerscale=2)
    save(figure, folder, "zeros_locus")


def passivity(folder: Path, results: dict[str, Any]) -> None:
    """Left: positive realness over frequency. Right: the law's own damping when its readings are late."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(13.5, 5.0))
    shown = {
        "joint torques -> joint rates": ("#111111", "-"),
        "the same, 31.2 ms late": ("#D55E00", "-"),
        "law's force -> true point's rate, 0.5 m": ("#56B4E9", "-"),
        "law's force -> true point's rate, tip": ("#0072B2", "-"),
    }
    names = {"the same, 31.2 ms late": "law's force -> rigid point's rate, tip, 31.2 ms late"}
    for name, (color, style) in shown.items():
        label = names.get(name, name)
        left.plot(results["omega"], results["curves"][name], color=color, linestyle=style, label=label)
    left.set(xscale="log", xlabel="frequency [rad/s]", ylabel="smallest eigenvalue of (G + G*)/2 over |G|")
    left.set_title(f"positive real? worst of {results['poses']} poses, default arm")
    left.legend(loc="lower left", fontsize=9)
    _law_damping(right, results["law"])
    save(figure, folder, "passivity")


def _law_damping(axis: Axes, law: dict[str, Any]) -> None:
    omega = np.array(law["omega"])
    axis.plot(omega, law["position"], color="#0072B2", label="position late, rate current")
    axis.plot(omega, law["position+rate"], color="#D55E00", label="position and rate late")
    axis.fill_between(omega, np.minimum(law["position+rate"], 0.0), 0.0, color="#D55E00", alpha=0.15)
    axis.axhline(0.0, color="0.4", linewidth=1)
    for joints, style in (("free", "-"), ("locked", ":")):
        for i, w in enumerate(w for w in law["modes"][joints] if 0.0 < w < omega[-1]):
            label = f"natural frequencies, joints {joints}" if i == 0 else None
            axis.axvline(w, color="0.55", linestyle=style, linewidth=1, label=label)
    axis.set(xlabel="frequency [rad/s]", ylabel="damping that the law supplies [N s/m]", xlim=(0, omega[-1]))
    axis.set_title(f"the law's damping, readings {1e3 * law['delay']:.1f} ms late")
    axis.set_ylim(-20, 33)
    axis.legend(loc="upper right", fontsize=9, ncols=2)


def margins(folder: Path, profile: dict[str, Any], simulated: list[dict[str, Any]], rows: list[dict[str, Any]]) -> None:
    """Delay margins along the lap, with the paper's delay and where the simulation diverges."""
    figure, axes = plt.subplots(2, len(SENSORS), figsize=(14, 7.6), sharex=True, sharey="row")
    side = profile["side"]
    arc = np.array(profile["arc"])
    half = np.concatenate([arc, side - arc[-2::-1]])
    lap = np.concatenate([*(half[:-1] + i * side for i in range(4)), [4.0 * side]])
    for column, sensor in enumerate(SENSORS):
        for row, delayed in enumerate(DELAYED):
            axis = axes[row, column]
            for curve in profile["curves"]:
                if (curve["sensor"], curve["delayed"]) == (sensor, delayed):
                    values = 1e3 * np.array(curve["margin"])
                    both = np.concatenate([values, values[-2::-1]])[:-1]
                    name = curve["controller"]
                    label = f"{name}, lambda = {GAINS[name]:.3g}"
                    axis.plot(lap, np.append(np.tile(both, 4), both[0]), color=COLORS[name], label=label)
            own = next(r for r in rows if (r["sensor"], r["delayed"]) == (sensor, delayed))["corner"]["delay"]
            axis.axhline(1e3 * own, color="#CC79A7", linestyle="--", linewidth=1.6, label="the paper's delay")
            _diverging(axis, [r for r in simulated if (r["sensor"], r["delayed"]) == (sensor, delayed)], side)
            axis.set_yscale("log")
            if row == 0:
                axis.set_title(sensor)
    for row, delayed in enumerate(DELAYED):
        axes[row, 0].set_ylabel(f"{LABELS[delayed]}:\ndelay margin [ms]")
    axes[0, 0].set_yticks([20, 50, 100, 200], ["20", "50", "100", "200"])
    axes[0, 0].set_yticks([], minor=True)
    axes[1, 0].set_yticks([0.2, 0.5, 1, 2, 5, 10, 30], ["0.2", "0.5", "1", "2", "5", "10", "30"])
    axes[1, 0].set_yticks([], minor=True)
    for axis in axes[-1]:
        axis.set(xlabel="arc length [m]; ticks are corners", xlim=(0, 4 * side))
        axis.set_xticks(side * np.arange(5))
    handles = dict(zip(*reversed(axes[0, 0].get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3)
    save(figure, folder, "margins")


def _diverging(axis: Axes, rows: list[dict[str, Any]], side: float) -> None:
    """Markers where the held arm diverges; a dotted level for the whole lap."""
    for r in rows:
        color = COLORS[r["controller"]]
        for place, at in (("corner", side), ("mid-side", 1.5 * side)):
            if r[place][1] is not None and np.isfinite(r[place][1]):
                label = "simulated: held there, diverges"
                axis.plot(at, 1e3 * r[place][1], "o", color=color, mfc="white", markersize=7, zorder=4, label=label)
        if "lap" in r and r["lap"][1] is not None and np.isfinite(r["lap"][1]):
            label = "simulated: the lap diverges"
            axis.plot(3.5 * side, 1e3 * r["lap"][1], "s", color=color, mfc="white", markersize=7, zorder=4, label=label)
