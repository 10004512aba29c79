"""Draws how far models are from the chain under plans with smoother and smoother torques, beside what these cost."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt

from flexarm_env.laps import LAPS
from scripts.common.plotting import WIDTH, headline, save
from scripts.validation.checks import Result
from scripts.validation.plant.pictures import NAMES
from scripts.validation.plant.study import MODELS


def draw(result: Result, folder: Path) -> None:
    """Draw the distances against the scores, one panel a lap."""
    laps = result.findings.records["laps"]
    figure, axes = plt.subplots(1, len(LAPS), figsize=(WIDTH, 4.0), sharey=True)
    for axis, lap in zip(axes, LAPS, strict=True):
        for model in MODELS[1:]:
            text, colour = NAMES[model.label]
            rows = [row for row in laps if row["lap"] == lap and row["plant"] == model.label]
            scores, away = ([1e3 * row[name] for row in rows] for name in ("score", "rms"))
            axis.plot(scores, away, "o-", color=colour)
            if axis is axes[0]:
                look = {"textcoords": "offset points", "color": colour, "ha": "right"}
                axis.annotate(text, (scores[-1], away[-1]), (0, 8 if model is MODELS[1] else -18), **look)
            if model is MODELS[1]:
                for row, x, y in zip(rows, scores, away, strict=True):
                    axis.annotate(f"{row['change_weight']:g}", (x, y), (4, 6), textcoords="offset points")
        axis.set(title=f"{lap} lap", xlabel="error of the lap [mm]", ylim=(0.0, 8.5))
        axis.margins(x=0.12)
    axes[0].set_ylabel("tip from the chain's, r.m.s. [mm]")
    headline(figure, "Distance from the MuJoCo chain under smoother plans; numbers: weight on smoothness [m²]")
    save(figure, folder, "smooth_plans")
