"""Picture of both engines and the best model: how far their tips are apart over time."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from scripts.common.plotting import COLOURS, WIDTH, headline, running_rms, save
from scripts.validation.checks import Result
from scripts.validation.engine.programmes import HELD
from scripts.validation.recorded import EVERY

WINDOW = round(0.1 / (EVERY * HELD))  # instants


def draw(result: Result, folder: Path) -> None:
    """One line a case: the engines on the left, the best model on the right."""
    figure, axes = plt.subplots(1, 2, figsize=(WIDTH, 4.8), sharex=True, sharey=True)
    cases = [row["case"] for row in result.findings.records["rows"]]
    for axis, what, title in zip(axes, ("engines", "model"), ("MuJoCo", "the best model"), strict=True):
        for name, colour in zip(cases, COLOURS, strict=False):
            away = result.findings.arrays[f"{name}, {what}"]
            time = EVERY * HELD * np.arange(1, len(away))
            axis.semilogy(time, 1e3 * running_rms(away[1:], WINDOW), color=colour, label=name.replace("_", " "))
        axis.set(title=f"{title} against Exudyn", xlabel="time [s]", ylim=(1e-4, 30.0))
    axes[0].set_ylabel("r.m.s. over 0.1 s [mm]")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncol=3)
    headline(figure, "Distance of two tips: two engines; and four polynomials a link against an engine")
    save(figure, folder, "two_engines")
