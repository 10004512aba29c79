"""Training curves: errors of the evaluation laps by environment steps, of all seeds of an agent, as data and picture.

The data of an agent stay in the file until its trainings are made anew, since trainings themselves are not committed.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt

from flexarm_agents.training.run_folder import RunFolder
from flexarm_env.laps import LAPS
from scripts.common.markdown import DOCS
from scripts.common.plotting import COLOURS, WIDTH, headline, label_ends, plain_ticks, plot_interquartile_mean, write
from scripts.common.result_files import write_json
from scripts.common.trainings import Training, curve

FOLDER = DOCS / "figures" / "agents"
Curves = Mapping[str, Sequence[Mapping[str, Any]]]  # of each agent, of each seed


def keep_curves(found: Mapping[str, Sequence[Training]], folder: Path = FOLDER) -> None:
    """Bring data and picture up to date."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "curves.json"
    known = json.loads(path.read_text()) if path.is_file() else {}
    known |= {name: [_curve(one) for one in trainings] for name, trainings in found.items()}
    write_json(path, known, levels=3)
    draw(known, path.with_suffix(".png"))


def _curve(training: Training) -> dict[str, Any]:
    rows = json.loads(RunFolder(training.folder).evaluations.with_suffix(".json").read_text())
    return {"seed": training.config.seed, **curve(rows)}


def draw(curves: Curves, path: Path) -> None:
    """Draw for both laps the interquartile mean over the seeds, with its interval."""
    figure, axes = plt.subplots(1, len(LAPS), figsize=(WIDTH, 4.2), sharey=True)
    for axis, lap in zip(axes, LAPS, strict=True):
        ends = []
        for (_, seeds), colour in zip(curves.items(), COLOURS, strict=False):
            steps, errors = _aligned(seeds, lap)
            ends.append(plot_interquartile_mean(axis, 1e-6 * steps, errors, color=colour))
        axis.set(title=f"{lap} lap", yscale="log", xlabel="million environment steps")
        plain_ticks(axis.yaxis)
    axes[0].set_ylabel("error of the evaluation lap [mm]")
    label_ends(axes[-1], list(zip(curves, COLOURS, strict=False)), ends)
    headline(figure, "Learning curves of the shipped agents: interquartile mean of the seeds, interval of 95 %")
    write(figure, path)


def _aligned(seeds: Sequence[Mapping[str, Any]], lap: str) -> tuple[np.ndarray, np.ndarray]:
    """Return steps and errors [m] of all seeds, infinite where lost; trainings of one agent are judged at the same."""
    count = min(len(seed["steps"]) for seed in seeds)
    errors = [[np.inf if error is None else error for error in seed[lap][:count]] for seed in seeds]
    return np.array(seeds[0]["steps"][:count], dtype=float), np.array(errors, dtype=float)
