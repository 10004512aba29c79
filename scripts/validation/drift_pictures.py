"""Picture of the drift: energy and angular momentum over time, and by step."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from scripts.common.plotting import COLOURS, SOFT, WIDTH, headline, save
from scripts.validation.checks import Result

FLOOR = 1e-13  # below it, rounding


def draw(result: Result, folder: Path) -> None:
    """Write both pictures."""
    rows = result.findings.records["rows"]
    over_time(result, rows, folder)
    by_step(rows, folder)


def over_time(result: Result, rows: list[dict[str, Any]], folder: Path) -> None:
    """Bent and spinning starts of the undamped arm with 1 and 2 modes."""
    arrays = result.findings.arrays
    time = arrays["time"] / 60.0
    figure, axes = plt.subplots(2, 2, figsize=(WIDTH, 6.2), sharex=True, sharey="row")
    for column, arm in zip(axes.T, ("1 mode", "2 modes"), strict=True):
        for row in rows:
            if row["arm"] != arm or row["start"] != "bent and spinning" or row["damping"] > 0.0:
                continue
            colour = COLOURS[[2e-3, 1e-3, 5e-4, 2.5e-4].index(row["step"])]
            for axis, what in zip(column, ("energy", "momentum"), strict=True):
                drift = np.maximum(np.abs(arrays[f"{what} {row['name']}"]), FLOOR)
                axis.semilogy(time[1:], drift[1:], color=colour, linewidth=0.9, label=f"{1e3 * row['step']:g} ms")
        column[0].set_title(f"{arm} a link")
        column[1].set_xlabel("simulated time [min]")
    axes[0, 0].set_ylabel("energy: relative change [1]")
    axes[1, 0].set_ylabel("momentum: change / scale [1]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncol=4, title="step")
    headline(figure, "Drift of an undamped arm that bends and spins, by the integrator's step")
    save(figure, folder, "drift_time")


def by_step(rows: list[dict[str, Any]], folder: Path) -> None:
    """Largest change by step, every arm and start."""
    figure, axes = plt.subplots(1, 2, figsize=(WIDTH, 7.2), sharex=True)
    arms = list(dict.fromkeys(row["arm"] for row in rows if row["damping"] == 0.0))
    marks = {"bent": "o", "spinning": "s", "bent and spinning": "^"}
    plain = [arm for arm in arms if "foreshortened" not in arm]
    for k, arm in enumerate(arms):
        colour = COLOURS[k % len(COLOURS)]
        line = "-" if arm in plain else "--"
        for start, mark in marks.items():
            same = [r for r in rows if (r["arm"], r["start"]) == (arm, start) and r["damping"] == 0.0]
            steps = [1e3 * r["step"] for r in same]
            for axis, what in zip(axes, ("energy", "momentum"), strict=True):
                axis.loglog(steps, [r[what] for r in same], marker=mark, color=colour, markersize=5, linestyle=line)
        bounds = {1e3 * r["step"]: r["bound"] for r in rows if r["arm"] == arm and r["damping"] == 0.0}
        axes[0].loglog(list(bounds), list(bounds.values()), color=colour, linestyle=":", linewidth=1.4)
        axes[1].plot([], [], color=colour, linestyle=line, label=arm)
    for start, mark in marks.items():
        axes[1].plot([], [], color=SOFT, marker=mark, linestyle="", label=start)
    axes[1].plot([], [], color=SOFT, linestyle=":", label="bound $\\omega^6 h^5 T / 72$")
    figure.legend(loc="outside lower left", ncol=3)
    axes[0].set(title="energy", ylabel="largest relative change [1]", xlabel="step [ms]")
    axes[1].set(title="angular momentum", ylabel="largest change / scale [1]", xlabel="step [ms]")
    headline(figure, "Drift over ten minutes by the integrator's step")
    ticks = sorted({1e3 * row["step"] for row in rows})
    for axis in axes:
        axis.set_xticks(ticks, [f"{t:g}" for t in ticks])
        axis.minorticks_off()
    save(figure, folder, "drift_step")
