"""Trains the agents of studies of learning anew, and measures them: `python -m scripts.learning.train`.

Finished trainings are reused. Errors by the delay are those at constant delays that no block of the observation tells:
blocks use the nominal delay of the environment.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from flexarm_agents import PPOConfig, StandardScore, evaluate, load_policy
from flexarm_agents.environments import make_one, settings_of
from flexarm_agents.training.config import RunConfig, optional, read_config
from flexarm_agents.training.loop import EVALUATION_SEED
from flexarm_env.laps import LAPS
from flexarm_env.validation import choice, integer
from scripts.common.command_line import read_options, run
from scripts.common.result_files import write_json
from scripts.common.study import Trial, Trials
from scripts.common.trainings import curve, trained
from scripts.learning import forecast
from scripts.learning.agents import FOLDER
from scripts.learning.conditions import DELAYS

STUDIES = ("delays", "reward", "teaching")  # files of data


@dataclass
class Options:
    """Train agents of studies anew, by the configurations in their data, and keep what was measured as their data."""

    only: tuple[str, ...] = ()
    """Names of agents in the data; the others' data stay. Without, all are trained."""
    seeds: int | None = None
    """How many trainings of each agent; without, as many as the data have."""
    jobs: int = 1
    """How many trainings run at once, on one core each."""
    output: Path = Path("results/trainings")
    """Folder for the trainings."""


def file(study: str) -> Path:
    """Return the data of a study: its agents, each with the `config` of its trainings (`scripts.learning.agents`)."""
    return FOLDER / f"{study}.json"


def training(name: str, config: RunConfig, folder: Path, late: bool) -> dict[str, Any]:
    """Train an agent, and measure it, also with other delays; see `scripts.learning.agents.Agent`.

    The `seconds` of processor time, with the evaluations, are None for a training that had begun before.
    """
    own, began = folder / name / f"seed-{config.seed}", time.process_time()
    fresh = not own.exists()
    if name.endswith("forecast"):
        assert isinstance(config, PPOConfig)
        policy, score, rows = forecast.trained(config)
    else:
        made = trained(config, own)
        policy, score = load_policy(made.folder).policy, made.score
        rows = json.loads((made.folder / "evaluations.json").read_text())
    seconds = time.process_time() - began if fresh else None
    figure = "duration" if settings_of(config.environment, config.options).mode.races else "rms"
    laps = score.as_mapping().items()
    best = {lap: {what: one[what] for what in ("complete", "duration", "rms")} for lap, one in laps}
    measured = {"errors": errors_by_delay(policy, config)} if late else {}
    return {"seconds": seconds, "seed": config.seed, "best": best, "curve": curve(rows, figure), "measured": measured}


def errors_by_delay(policy: Any, config: RunConfig) -> dict[str, list[float | None]]:
    """Return the r.m.s. error of each lap at constant delays [m]; None where it is lost."""
    scores: list[StandardScore] = []
    for delay in DELAYS:
        constant = {"randomisation": {"delay": (1e-3 * delay, 1e-3 * delay)}}
        env = make_one(config.environment, config.options | constant)
        scores.append(evaluate(env, policy, EVALUATION_SEED))
        env.close()
    return {lap: [getattr(score, lap).rms for score in scores] for lap in LAPS}


def agents(found: Mapping[str, Mapping[str, Any]], names: Mapping[str, RunConfig]) -> dict[str, Any]:
    """Gather the trainings of each agent."""
    made = {}
    for name, config in names.items():
        own = [dict(one) for label, one in found.items() if label.rpartition(" ")[0] == name]
        seconds = [x for x in [one.pop("seconds") for one in own] if x is not None]
        steps = own[0]["curve"]["steps"][-1]
        million = round(float(np.median(seconds)) * 1e6 / steps, 1) if seconds else None
        made[name] = {"config": config.plain(), "seconds": million, "trainings": own}
    return made


def main() -> None:
    """Train, measure, and write the data."""
    given = read_options("python -m scripts.learning.train", Options())
    every = {study: json.loads(file(study).read_text()) for study in STUDIES}
    names = [name for data in every.values() for name in data]
    chosen = {choice("only", name, names) for name in given.only or names}
    optional("seeds", given.seeds, integer, least=1)

    def trials() -> dict[str, Trial]:
        made = {
            (seed, name): partial(training, name, replace(read_config(agent["config"]), seed=seed), given.output, late)
            for late, data in ((study == "delays", data) for study, data in every.items())
            for name, agent in data.items()
            for seed in range(given.seeds or len(agent["trainings"]))
            if name in chosen
        }
        return {f"{name} {seed}": made[seed, name] for seed, name in sorted(made, key=lambda one: one[0])}

    given.output.mkdir(parents=True, exist_ok=True)
    found = Trials("scripts.learning.train", trials)(given.output, given.jobs)
    for study, data in every.items():
        if configs := {name: read_config(data[name]["config"]) for name in data if name in chosen}:
            write_json(file(study), data | agents(found, configs), levels=5)


if __name__ == "__main__":
    run(main)
