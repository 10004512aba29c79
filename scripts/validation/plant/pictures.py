"""Picture of the plant's study: how far arms are from the chain over a lap."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from flexarm_env.laps import LAPS
from scripts.common.plotting import COLOURS, save
from scripts.validation.checks import Result
from scripts.validation.engine.programmes import HELD
from scripts.validation.plant.drivers import PERIODS, WEIGHTS
from scripts.validation.plant.study import FORMER, MODELS


def draw(result: Result, folder: Path) -> None:
    """Draw the distance from the chain over time, one panel a lap, under gentle feedback along the plan."""
    arrays, controller = result.findings.arrays, f"plan with {next(iter(WEIGHTS))} feedback"
    figure, axes = plt.subplots(len(LAPS), figsize=(9, 7), sharex=True)
    for axis, lap in zip(axes, LAPS, strict=True):
        chain = arrays[f"{lap}, {controller}, chain"]
        for model, colour in zip((*MODELS, FORMER), COLOURS, strict=False):
            away = 1e3 * np.linalg.norm(arrays[f"{lap}, {controller}, {model.label}"] - chain, axis=1)
            axis.semilogy(HELD * PERIODS * np.arange(len(away)), away + 1e-3, color=colour, label=model.label)
        axis.set(title=f"{lap} lap, {controller}", ylabel="tip from the chain's [mm]", ylim=(0.05, None))
    axes[0].legend(fontsize=9)
    axes[-1].set_xlabel("time [s]")
    save(figure, folder, "plant_distance")
