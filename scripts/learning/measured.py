"""What studies measure of agents: errors of laps at the points of an axis, kept as cells, and what learning costs."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from flexarm_agents import DescentConfig, TrainingConfig
from flexarm_agents.board.cells import Cell, Store
from flexarm_agents.board.columns import Point
from flexarm_agents.board.rows import Row
from flexarm_agents.descent.training import Descent
from flexarm_agents.training.config import RunConfig
from flexarm_agents.training.models import new_model
from flexarm_agents.training.run_folder import RunFolder
from flexarm_agents.training.train import one_thread
from flexarm_env.laps import LAPS
from scripts.common.cells import results
from scripts.common.result_files import write_json
from scripts.common.trainings import Training

Errors = dict[str, list[float | None]]  # of each lap, at each point [m]; None for a lost lap
SAMPLE = 65_536  # steps whose time is measured
UPDATES = 1000  # of SAC and TQC, where it is theirs


def errors_at(row: Row, points: Sequence[Point], folder: Path) -> Errors:
    """Return the r.m.s. errors of a row's laps at some points; cells are kept.

    Args:
        row: the agent.
        points: where, with one seed.
        folder: of the cells.

    Raises:
        ValueError: if the agent cannot be run at one of them.
    """
    found: Errors = {lap: [] for lap in LAPS}
    made = results([Cell.of(row, point) for point in points], Store(folder))
    for point, result in zip(points, made, strict=True):
        if "not_applicable" in result:
            raise ValueError(f"row {row.name} at {point.value}: {result['not_applicable']}")
        for episode in result["episodes"]:
            figures = episode["figures"]
            found[episode["lap"]].append(None if figures is None else float(figures["rms"]))
    return found


def measure_at(points: Sequence[Point]) -> Callable[[Training, Path], dict[str, Any]]:
    """Return a study's `measure`: the errors of both laps at some points, under "errors".

    Args:
        points: see `errors_at`.
    """

    def measure(training: Training, folder: Path) -> dict[str, Any]:
        row = Row(str(training.folder), training.folder.parent.name)
        return {"errors": errors_at(row, points, folder / "cells")}

    return measure


def mean_of_laps(errors: Errors, n: int) -> float | None:
    """Return the mean over the laps at a point [m]; None if one of them is lost."""
    values = [errors[lap][n] for lap in LAPS]
    return None if None in values else float(np.mean([value for value in values if value is not None]))


def seconds_per_million(config: RunConfig, path: Path) -> float:
    """Return the processor time that a million steps of a training take [s], without evaluations; it is kept.

    Args:
        config: of the training.
        path: of the file that keeps it, with the configuration that was measured.
    """
    if path.is_file():
        known = json.loads(path.read_text())
        if known.get("config") == config.plain():
            return float(known["seconds"])
    with one_thread():
        seconds, steps = _sample(config) if isinstance(config, TrainingConfig) else _sample_of_descent(config)
    path.parent.mkdir(parents=True, exist_ok=True)
    seconds = round(1e6 * seconds / steps, 1)
    write_json(path, {"config": config.plain(), "seconds": seconds, "steps": steps})
    return seconds


def _sample(config: TrainingConfig) -> tuple[float, int]:
    """Return processor time [s] and steps of a sample of a training by reward."""
    size = config.envs * (config.rollout or config.train_every or 1)
    first, sample = max(size, config.learning_starts or 0), SAMPLE
    if config.updates is not None:
        sample = UPDATES // config.updates * size
    steps = -(-sample // size) * size
    model = new_model(replace(config, steps=first + steps))
    model.learn(first)  # compiles, and fills a replay buffer for the first update
    began = time.process_time()
    model.learn(steps, reset_num_timesteps=False)
    return time.process_time() - began, steps


def _sample_of_descent(config: RunConfig) -> tuple[float, int]:
    """Return processor time [s] and steps of a sample of a training by first-order gradients.

    Raises:
        TypeError: for another kind of training.
    """
    if not isinstance(config, DescentConfig):
        raise TypeError(f"config = {config!r}: must be a TrainingConfig or a DescentConfig")
    descent = Descent(config, RunFolder(config.folder))
    windows = -(-SAMPLE // (config.horizon * config.arms))
    descent.window()  # compiles
    began = time.process_time()
    for _ in range(windows):
        descent.window()
    seconds = time.process_time() - began
    descent.driver.env.close()
    return seconds, windows * config.horizon * config.arms
