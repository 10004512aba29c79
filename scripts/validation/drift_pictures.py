"""Pictures of the energy's drift, over time and by step; angular momentum is kept to rounding."""

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
    figure, axes = plt.subplots(1, 2, figsize=(WIDTH, 3.8), sharey=True)
    for axis, arm in zip(axes, ("1 mode", "2 modes"), strict=True):
        for row in rows:
            if row["arm"] != arm or row["start"] != "bent and spinning" or row["damping"] > 0.0:
                continue
            drift = np.maximum(np.abs(arrays[f"energy {row['name']}"]), FLOOR)
            colour = COLOURS[[2e-3, 1e-3, 5e-4, 2.5e-4].index(row["step"])]
            axis.semilogy(time[1:], drift[1:], color=colour, linewidth=0.9, label=f"{1e3 * row['step']:g} ms")
        axis.set(title=f"{arm} a link", xlabel="simulated time [min]")
    axes[0].set_ylabel("energy: relative change [1]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncol=4, title="step")
    headline(figure, "Drift of an undamped arm that bends and spins, by the integrator's step")
    save(figure, folder, "drift_time")


def by_step(rows: list[dict[str, Any]], folder: Path) -> None:
    """Largest change of energy by step, every arm and start."""
    figure, axis = plt.subplots(figsize=(WIDTH, 5.6))
    undamped = [row for row in rows if row["damping"] == 0.0]
    marks = {"bent": "o", "spinning": "s", "bent and spinning": "^"}
    for k, arm in enumerate(dict.fromkeys(row["arm"] for row in undamped)):
        look: dict[str, Any] = {
            "color": COLOURS[k % len(COLOURS)],
            "linestyle": "--" if "foreshortened" in arm else "-",
        }
        for start, mark in marks.items():
            same = [row for row in undamped if (row["arm"], row["start"]) == (arm, start)]
            axis.loglog([1e3 * r["step"] for r in same], [r["energy"] for r in same], marker=mark, markersize=5, **look)
        bounds = {1e3 * row["step"]: row["bound"] for row in undamped if row["arm"] == arm}
        axis.loglog(list(bounds), list(bounds.values()), color=look["color"], linestyle=":", linewidth=1.4)
        axis.plot([], [], label=arm, **look)
    for start, mark in marks.items():
        axis.plot([], [], color=SOFT, marker=mark, linestyle="", label=start)
    axis.plot([], [], color=SOFT, linestyle=":", label="bound $\\omega^6 h^5 T / 72$")
    figure.legend(loc="outside lower left", ncol=3)
    axis.set(ylabel="energy: largest relative change [1]", xlabel="step [ms]")
    axis.set_title("Drift of energy over ten minutes by the integrator's step")
    ticks = sorted({1e3 * row["step"] for row in rows})
    axis.set_xticks(ticks, [f"{t:g}" for t in ticks])
    axis.minorticks_off()
    save(figure, folder, "drift_step")
