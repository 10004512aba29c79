"""Picture of the integrators' orders."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from scripts.common.plotting import COLOURS, INK, SOFT, WIDTH, headline, save
from scripts.validation.checks import Result


def draw(result: Result, folder: Path) -> None:
    """Error by step, one line an integrator and problem."""
    figure, axis = plt.subplots(figsize=(WIDTH, 6.4))
    colours = (*COLOURS, INK)
    for row, colour in zip(result.findings.records["rows"], colours, strict=False):
        label = f"{row['name']}: {row['order']:.2f}"
        axis.loglog(1e3 * np.array(row["steps"]), row["errors"], "o-", color=colour, label=label)
    steps = np.array([0.03, 1.0])
    for order, height in ((4, 1e-3), (3, 3e-3)):
        axis.loglog(steps, height * steps**order, color=SOFT, linestyle=":")
        axis.annotate(f"order {order}", (steps[-1], height), xytext=(4, 0), textcoords="offset points", color=SOFT)
    axis.set(xlabel="step [ms]", ylabel="largest error / range [1]")
    ticks = (0.03125, 0.0625, 0.125, 0.25, 0.5, 1.0)
    axis.set_xticks(ticks, [f"{t:g}" for t in ticks])
    axis.minorticks_off()
    figure.legend(loc="outside lower left")
    headline(figure, "Errors of the integrators by their step, with the observed orders")
    save(figure, folder, "orders")
