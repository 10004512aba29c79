"""Pictures of the plant's studies: how far arms are from the chain over a lap."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from flexarm_env.laps import LAPS
from scripts.common.plotting import (
    BLUE,
    COLOURS,
    GREEN,
    ORANGE,
    WIDTH,
    headline,
    label_ends,
    plain_ticks,
    running_rms,
    save,
)
from scripts.validation.checks import Array, Result
from scripts.validation.engine.programmes import HELD
from scripts.validation.plant.drivers import PERIODS, WEIGHTS
from scripts.validation.plant.study import FORMER, MODELS

WINDOW = 50  # control periods: half a second
LOST = 2.5  # a tip that is further from the chain's is lost, too [m]
NAMES = dict(
    zip(
        [model.label for model in (*MODELS, FORMER)],
        [("2 shapes", GREEN), ("default arm:\n3 shapes", BLUE), ("4 shapes", COLOURS[5]), ("linear arm", ORANGE)],
        strict=True,
    )
)


def draw(result: Result, folder: Path) -> None:
    """Draw the distance from the chain over time under gentle feedback along the plan."""
    arrays, controller = result.findings.arrays, f"plan with {next(iter(WEIGHTS))} feedback"
    chains = {lap: arrays[f"{lap}, {controller}, chain"] for lap in LAPS}
    lines = {
        (lap, look): np.linalg.norm(arrays[f"{lap}, {controller}, {label}"] - chains[lap], axis=1)
        for lap in LAPS
        for label, look in NAMES.items()
    }
    over_time(
        lines, "Distance of each model's tip from the MuJoCo chain's along the best plans", folder, "plant_distance"
    )


def over_time(lines: Mapping[tuple[str, tuple[str, str]], Array], title: str, folder: Path, name: str) -> None:
    """Draw distances over a lap, one panel a lap.

    Args:
        lines: distances in each control period [m], as far as the laps go, by lap, and by text and colour of the line.
        title: of the picture.
        folder: for the files.
        name: of the picture.
    """
    figure, axes = plt.subplots(len(LAPS), figsize=(WIDTH, 6.4), sharex=True)
    for axis, lap in zip(axes, LAPS, strict=True):
        own = {look: 1e3 * running_rms(away, WINDOW) for (one, look), away in lines.items() if one == lap}
        for (_, colour), away in own.items():
            axis.semilogy(HELD * PERIODS * np.arange(len(away)), away, color=colour, linewidth=1.6)
        axis.set(title=f"{lap} lap", ylabel="r.m.s. over 0.5 s [mm]", ylim=(0.5, 1000.0), xlim=(0.0, 16.0))
        plain_ticks(axis.yaxis)
        axis.set_xticks(range(0, 17, 4))
        label_ends(axis, [*own], [away[-1] for away in own.values()])
    axes[-1].set_xlabel("time [s]")
    headline(figure, title)
    save(figure, folder, name)
