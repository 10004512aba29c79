"""Draws how far the default arm is from the chain under each controller of the group "controllers"."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from flexarm_env.laps import LAPS
from scripts.common.plotting import COLOURS, save
from scripts.validation.checks import Result
from scripts.validation.engine.programmes import HELD
from scripts.validation.plant.drivers import PERIODS


def draw(result: Result, folder: Path) -> None:
    """Draw the distance over time, one panel a lap."""
    arrays = result.findings.arrays
    figure, axes = plt.subplots(len(LAPS), figsize=(9, 7), sharex=True)
    for axis, lap in zip(axes, LAPS, strict=True):
        names = [name for name in arrays if name.startswith(f"{lap}, ")]
        for name, colour in zip(names, COLOURS, strict=False):
            away = 1e3 * arrays[name]
            axis.semilogy(
                HELD * PERIODS * np.arange(len(away)), away + 1e-3, color=colour, label=name.partition(", ")[2]
            )
        axis.set(title=f"{lap} lap", ylabel="default arm's tip from the chain's [mm]", ylim=(0.05, None))
    axes[0].legend(fontsize=9)
    axes[-1].set_xlabel("time [s]")
    save(figure, folder, "controllers_distance")
