"""Trains the agents of studies of learning anew, and measures them: `python -m scripts.learning.train`.

Finished trainings are reused. Errors by the delay are those at constant delays that no block of the observation tells:
blocks use the nominal delay of the environment.
"""

import hashlib
import json
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from flexarm_agents import StandardScore, evaluate, load_policy
from flexarm_agents.environments import make_one, settings_of
from flexarm_agents.training.config import RunConfig, optional, read_config
from flexarm_agents.training.loop import EVALUATION_SEED
from flexarm_env.laps import LAPS
from flexarm_env.validation import choice, integer
from scripts.common.command_line import read_options, run
from scripts.common.result_files import write_json
from scripts.common.study import Trials
from scripts.common.trainings import curve, trained
from scripts.learning import forecast, inverse
from scripts.learning.agents import FOLDER
from scripts.learning.conditions import DELAYS
from scripts.learning.judge import Outcome

STUDIES = ("delays", "reward", "teaching")  # files of data
# Trainings that are a study's own, by the last word of an agent's name.
OF_STUDIES: Mapping[str, Callable[[Any], Outcome]] = {"forecast": forecast.trained, "inverse": inverse.trained}


@dataclass
class Options:
    """Train agents of studies anew, by the configurations in their data, and keep what was measured as their data."""

    only: tuple[str, ...] = ()
    """Names of agents in the data; the others' data stay. Without, all are trained."""
    seeds: int | None = None
    """How many trainings of each agent; without, as many as the data have."""
    jobs: int = 1
    """How many trainings run at once, on one core each."""
    output: Path = Path("results/learning/trainings")
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
    if (kind := name.rpartition("-")[2]) in OF_STUDIES:
        policy, score, rows = OF_STUDIES[kind](config)
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
        with make_one(config.environment, config.options | constant) as env:
            scores.append(evaluate(env, policy, EVALUATION_SEED))
    return {lap: [getattr(score, lap).rms for score in scores] for lap in LAPS}


def agents(
    found: Mapping[str, Mapping[str, Any]], data: Mapping[str, Mapping[str, Any]], names: Collection[str]
) -> dict[str, Any]:
    """Gather the trainings of agents in the data, by the results of trials; a time is new where all trainings are."""
    made = {}
    for name in names:
        own = [dict(one) for key, one in found.items() if key.split()[0] == name]
        seconds = [one.pop("seconds") for one in own]
        million = data[name]["seconds"]
        if None not in seconds:
            million = round(float(np.median(seconds)) * 1e6 / own[0]["curve"]["steps"][-1], 1)
        made[name] = {"config": data[name]["config"], "seconds": million, "trainings": own}
    return made


def label(name: str, config: RunConfig) -> str:
    """Name a training, so that the results of one with another configuration are not taken for its own."""
    text = json.dumps(config.plain(), sort_keys=True)
    return f"{name} {config.seed} {hashlib.sha256(text.encode()).hexdigest()[:8]}"


def main() -> None:
    """Train, measure, and write the data."""
    given = read_options("python -m scripts.learning.train", Options())
    integer("jobs", given.jobs, 1)
    optional("seeds", given.seeds, integer, least=1)  # a new agent has none in its data
    every = {study: json.loads(file(study).read_text()) for study in STUDIES}
    names = [name for data in every.values() for name in data]
    chosen = {choice("only", name, names) for name in given.only or names}

    jobs = [
        (replace(read_config(agent["config"]), seed=seed), name, study == "delays")
        for study, data in every.items()
        for name, agent in data.items()
        if name in chosen
        for seed in range(integer("seeds", given.seeds or len(agent["trainings"]), 1))
    ]
    jobs.sort(key=lambda job: job[0].seed)  # all with the first seed, then the others
    trials = {label(name, own): partial(training, name, own, given.output, late) for own, name, late in jobs}
    given.output.mkdir(parents=True, exist_ok=True)
    found = Trials("scripts.learning.train", lambda: trials)(given.output, given.jobs)
    for study, data in every.items():
        if own := [name for name in data if name in chosen]:
            present = json.loads(file(study).read_text())  # another run may have written it
            write_json(file(study), present | agents(found, data, own), levels=5)


if __name__ == "__main__":
    run(main)
