"""Picture of the error of a step against its cost."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from scripts.common.plotting import COLOURS, SOFT, THRESHOLD, WIDTH, save
from scripts.validation.checks import Result


def draw(result: Result, folder: Path) -> None:
    """Median error by evaluations in a control period, one line an arm; a ring marks the default."""
    figure, axis = plt.subplots(figsize=(WIDTH, 5.0))
    for row, colour in zip(result.findings.records["rows"], COLOURS, strict=False):
        cost, error = 4 * np.array(row["counts"]), 1e3 * np.array(row["median"])
        axis.loglog(cost, error, "o-", color=colour, markersize=4)
        axis.annotate(row["arm"], (cost[-1], error[-1]), xytext=(6, 0), textcoords="offset points", color=colour)
        at = row["counts"].index(row["default"])
        axis.plot(cost[at], error[at], "o", color=colour, markersize=12, fillstyle="none")
    axis.axhline(0.1, **THRESHOLD)
    axis.annotate("0.1 mm", (300.0, 0.1), xytext=(0, 4), textcoords="offset points", color=SOFT)
    axis.set(
        xlabel="evaluations of the equations in a control period of 10 ms",
        ylabel="error of the tip after a second [mm]",
        title="Median error under full random torques; rings: the environments' default",
    )
    ticks = (16, 20, 28, 40, 56, 80, 112)
    axis.set_xticks(ticks, [str(tick) for tick in ticks])
    axis.minorticks_off()
    axis.set_xlim(14.0, 450.0)
    save(figure, folder, "steps")
