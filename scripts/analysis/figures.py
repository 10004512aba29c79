"""Pictures of the analysis, drawn from its results: PNG for reading, SVG for print."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from scripts.analysis.margins import GAINS, SENSORS
from scripts.common.plotting import COLOURS, save

COLORS = {"IFDC": "#111111", "FLSAC, largest": "#D55E00", "FLSAC, smallest": "#0072B2"}
EXACT = "0.6"
COLLOCATED = "joint torques -> joint rates"
KINDS: dict[str, dict[str, Any]] = {
    "right of the axis, real": {"color": "#D55E00", "markersize": 2.6},
    "right of the axis, complex": {"color": "#009E73", "markersize": 2.6},
    "on the imaginary axis": {"color": "#0072B2", "markersize": 2.6},
    "left of the axis, complex": {"color": "#56B4E9", "markersize": 2.6},
    "left of the axis, real": {"color": "#E69F00", "markersize": 1.2},
}
LINES: dict[str, dict[str, Any]] = {  # the two large gains' curves lie close: a thin one on a broad one
    "FLSAC, smallest": {"color": COLORS["FLSAC, smallest"], "linewidth": 1.5, "zorder": 2.5},
    "FLSAC, largest": {"color": COLORS["FLSAC, largest"], "linewidth": 4.5, "alpha": 0.6},
    "IFDC": {"color": COLORS["IFDC"], "linewidth": 1.2, "zorder": 3},
}
WHOLE_LAP = 4.35  # sides; where the squares of whole laps stand
LABELS = {"position": "position late", "position+rate": "position and rate late"}


def zeros_locus(folder: Path, locus: dict[str, Any]) -> None:
    """Magnitude of every zero against the sensor's position, a panel for each arm."""
    models = [name for name in locus if name not in ("positions", "exact beam", "exact link 1")]
    s = np.array(locus["positions"])
    figure, axes = plt.subplots(1, len(models), figsize=(4.2 * len(models), 5.4), sharey=True, squeeze=False)
    for axis, name in zip(axes[0], models, strict=True):
        exact = [
            (at, z)
            for at, row in zip(s, locus["exact beam"], strict=True)
            for z in (*row["real"], *row["imaginary"], *locus["exact link 1"])
        ]
        axis.plot(*np.array(exact).T, "o", color=EXACT, markersize=1.6, zorder=1, label="exact beams, both links")
        kinds: dict[str, list[tuple[float, float]]] = {kind: [] for kind in KINDS}
        for at, row in zip(s, locus[name], strict=True):
            for z in row:
                kinds[_kind(complex(*z))].append((at, abs(complex(*z))))
        for kind, points in kinds.items():
            # an undamped arm's zeros on the left are mirror images of those on the right
            if points and not (kind.startswith("left") and "undamped" in name):
                axis.plot(*np.array(points).T, "o", label=kind, zorder=3, **KINDS[kind])
        axis.set(title=name, xlabel="sensor position s on link 2 [m]", yscale="log", ylim=(10, 1000), xlim=(0, 4.6))
    axes[0, 0].set_ylabel("magnitude of the zero [rad/s]")
    handles: dict[str, Any] = {}
    for axis in axes[0]:
        handles |= dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, markerscale=2)
    save(figure, folder, "zeros_locus")


def _kind(zero: complex) -> str:
    """Where a zero lies: a key of `KINDS`."""
    tiny = 1e-6 * abs(zero)
    if abs(zero.real) <= tiny:
        return "on the imaginary axis"
    shape = "real" if abs(zero.imag) <= tiny else "complex"
    return f"{'right' if zero.real > 0.0 else 'left'} of the axis, {shape}"


def passivity(folder: Path, results: dict[str, Any]) -> None:
    """Left: positive realness over frequency. Right: the law's own damping when its readings are late."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(13.5, 5.0))
    left.plot(results["omega"], results["curves"][COLLOCATED], color="#111111", linewidth=2, label=COLLOCATED)
    late = [row["path"] for row in results["rows"] if row["worst"] < -1e-9]
    for name, color in zip(late, COLOURS, strict=False):
        after = [row["path"] for row in results["rows"]]
        label = name.replace("the same", after[after.index(name) - 1])  # the row above it in the table
        left.plot(results["omega"], results["curves"][name], color=color, linewidth=1.3, label=label)
    left.set(
        xscale="log",
        xlabel="frequency [rad/s]",
        ylabel="least eigenvalue of $(G + G^H)/2$\nover the largest singular value of $G$",
    )
    left.set_title(f"positive real? worst of {results['poses']} poses, linear arm")
    left.set_ylim(-1.05, 0.75)  # room for the legend
    left.legend(loc="upper left", fontsize=8.5)
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
    """Delay margins along the lap, with the paper's delay and where the simulation diverges, on one scale."""
    figure, axes = plt.subplots(1, len(SENSORS), figsize=(14, 6.4), sharex=True, sharey=True)
    side = profile["side"]
    arc = np.array(profile["arc"])
    half = np.concatenate([arc, side - arc[-2::-1]])
    lap = np.concatenate([*(half[:-1] + i * side for i in range(4)), [4.0 * side]])
    for axis, sensor in zip(axes, SENSORS, strict=True):
        for curve in (c for c in profile["curves"] if c["sensor"] == sensor):
            values = 1e3 * np.array(curve["margin"])
            both = np.concatenate([values, values[-2::-1]])[:-1]
            name = curve["controller"]
            label = f"{name}, lambda = {GAINS[name]:.3g}"
            axis.plot(lap, np.append(np.tile(both, 4), both[0]), label=label, **LINES[name])
        own = next(r for r in rows if r["sensor"] == sensor)["corner"]["delay"]
        axis.axhline(1e3 * own, color="#CC79A7", linestyle="--", linewidth=1.6, label="the paper's delay")
        _diverging(axis, [r for r in simulated if r["sensor"] == sensor], side)
        axis.set(title=sensor, yscale="log", xlim=(0, WHOLE_LAP * side + 0.5 * side), xlabel="arc length [m]")
        axis.axvline(4.0 * side, color="0.7", linewidth=1)
        corners = [f"{side * i:.1f}" for i in range(4)]
        axis.set_xticks(side * np.array([0, 1, 2, 3, WHOLE_LAP]), [*corners, "whole\nlap"])
        for delayed, height in (("position", 0.985), ("position+rate", 0.02)):
            up = "top" if height > 0.5 else "bottom"
            axis.text(0.02, height, LABELS[delayed], transform=axis.transAxes, va=up, style="italic")
    axes[0].set_ylabel("delay margin [ms]")
    axes[0].set_ylim(0.08, 320)
    ticks = [0.1, 0.3, 1, 3, 10, 30, 100]
    axes[0].set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes[0].set_yticks([], minor=True)
    handles = dict(zip(*reversed(axes[0].get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3)
    save(figure, folder, "margins")


def _diverging(axis: Axes, rows: list[dict[str, Any]], side: float) -> None:
    """Circles where the held arm diverges; squares, behind the lap's end, for whole laps."""
    for r in rows:
        look: dict[str, Any] = {"color": COLORS[r["controller"]], "mfc": "white", "markersize": 7, "zorder": 4}
        look["linestyle"] = "none"
        for place, at in (("corner", side), ("mid-side", 1.5 * side)):
            if r[place][1] is not None and np.isfinite(r[place][1]):
                axis.plot(at, 1e3 * r[place][1], marker="o", label="simulated: held there, diverges", **look)
        if "lap" in r and r["lap"][1] is not None and np.isfinite(r["lap"][1]):
            label = "simulated: the whole lap diverges"
            axis.plot(WHOLE_LAP * side, 1e3 * r["lap"][1], marker="s", label=label, **look)
