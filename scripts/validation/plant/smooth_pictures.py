"""Draws how far models are from the chain under plans with smoother and smoother torques, beside what these cost."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt

from flexarm_env.laps import LAPS
from scripts.common.plotting import COLOURS, save
from scripts.validation.checks import Result
from scripts.validation.plant.smooth import GOAL
from scripts.validation.plant.study import MODELS


def draw(result: Result, folder: Path) -> None:
    """Draw the distances against the scores, one panel a lap."""
    laps = result.findings.records["laps"]
    figure, axes = plt.subplots(1, len(LAPS), figsize=(10, 4.2), sharey=True)
    for axis, lap in zip(axes, LAPS, strict=True):
        for model, colour in zip(MODELS[1:], COLOURS, strict=False):
            rows = [row for row in laps if row["lap"] == lap and row["plant"] == model.label]
            scores, away = ([1e3 * row[name] for row in rows] for name in ("score", "rms"))
            axis.plot(scores, away, "o-", color=colour, label=model.label)
            if model is MODELS[1]:
                for row, x, y in zip(rows, scores, away, strict=True):
                    axis.annotate(f"{row['change_weight']:g}", (x, y), (4, 6), textcoords="offset points", fontsize=8)
        axis.axhline(GOAL, color="grey", linestyle="--", linewidth=1)
        axis.set(title=f"{lap} lap", xlabel="score of the model [mm]", ylim=(0.0, None))
    axes[0].set_ylabel("tip from the chain's, r.m.s. [mm]")
    axes[0].legend(fontsize=9, title="by weight on changes of the torques")
    save(figure, folder, "smooth_plans")
