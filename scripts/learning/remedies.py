"""Trains and measures the agents of the studies of late sensors and critics: `python -m scripts.learning.remedies`.

Finished trainings are reused. The errors are those at constant delays that no block of the observation tells: blocks
use the nominal delay of the environment.
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

from flexarm_agents import PPOConfig, RecurrentPPOConfig, StandardScore, evaluate, load_policy
from flexarm_agents.environments import make_one
from flexarm_agents.training.config import RunConfig
from flexarm_agents.training.loop import EVALUATION_SEED
from flexarm_env.laps import LAPS
from flexarm_env.validation import choice, integer
from scripts.common.command_line import read_options, run
from scripts.common.result_files import write_json
from scripts.common.study import Trial, Trials
from scripts.common.trainings import BEHIND_FILTER, trained
from scripts.learning import forecast
from scripts.learning.agents import FOLDER
from scripts.learning.conditions import DELAYS

FILE = FOLDER / "delays.json"
STEPS = 1_000_000
PAST = (1, 2, 3, 4, 6, 8)
TRAINED = {"known": ("FlexArm/SquareDelayEasy-v0", 1), "unknown": ("FlexArm/SquareDelayMedium-v0", 3)}


@dataclass
class Options:
    """Train the agents of the studies of late sensors and of critics, measure them, and keep that as their data."""

    only: tuple[str, ...] = ()
    """Names of agents in the data; the others' data stay. Without, all are trained."""
    seeds: int = 5
    """How many trainings of each agent."""
    jobs: int = 1
    """How many trainings run at once, on one core each."""
    output: Path = Path("results/remedies")
    """Folder for the trainings."""


def configs() -> dict[str, RunConfig]:
    """Return the configuration of each agent, by its name in the data."""
    found: dict[str, RunConfig] = {}
    for trained_at, (environment, laps) in TRAINED.items():
        own: dict[str, Any] = {"environment": environment, "evaluation_laps": laps}
        own |= {"steps": STEPS, "evaluate_every": STEPS // 10, "options": {"last_actions": 1}}
        found |= {
            f"{trained_at}-none": PPOConfig(**own),
            f"{trained_at}-actions": PPOConfig(**own | {"options": {"last_actions": 8}}),
            f"{trained_at}-stacked": PPOConfig(**own, lags=PAST),
            f"{trained_at}-forecast": PPOConfig(**own, lags=PAST),
            f"{trained_at}-recurrent": RecurrentPPOConfig(**own),
            f"{trained_at}-observer": PPOConfig(
                **own | {"options": {"last_actions": 1, "observation": BEHIND_FILTER}},
                observer="nominal" if trained_at == "known" else "delay",
            ),
        }
    return found | {"unknown-privileged": PPOConfig(**own, lags=PAST, privileged_critic=True)}


def training(name: str, config: RunConfig, folder: Path) -> dict[str, Any]:
    """Train an agent, and measure it; see `scripts.learning.agents.Agent`.

    The `seconds` of processor time, with the evaluations, are None for a training that had begun before.
    """
    own, began = folder / name / f"seed-{config.seed}", time.process_time()
    fresh = not own.exists()
    if name.endswith("forecast"):
        assert isinstance(config, PPOConfig)
        policy, best, rows = forecast.trained(config)
    else:
        made = trained(config, own)
        policy, best = load_policy(made.folder).policy, made.score
        rows = json.loads((made.folder / "evaluations.json").read_text())
    seconds = time.process_time() - began if fresh else None
    laps = {lap: {"rms": getattr(best, lap).rms} for lap in LAPS}
    curve = {"steps": [row["steps"] for row in rows], **{lap: [row[lap]["rms"] for row in rows] for lap in LAPS}}
    errors = errors_by_delay(policy, config)
    return {"seconds": seconds, "seed": config.seed, "best": laps, "curve": curve, "measured": {"errors": errors}}


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
        million = round(float(np.median(seconds)) * 1e6 / STEPS, 1) if seconds else None
        made[name] = {"config": config.plain(), "seconds": million, "trainings": own}
    return made


def main() -> None:
    """Train, measure, and write the data."""
    given, every = read_options("python -m scripts.learning.remedies", Options()), configs()
    named = {name: every[choice("only", name, tuple(every))] for name in given.only or every}
    seeds = range(integer("seeds", given.seeds, 1))

    def trials() -> dict[str, Trial]:
        return {
            f"{name} {seed}": partial(training, name, replace(config, seed=seed), given.output)
            for seed in seeds
            for name, config in named.items()
        }

    given.output.mkdir(parents=True, exist_ok=True)
    found = Trials("scripts.learning.remedies", trials)(given.output, given.jobs)
    write_json(FILE, json.loads(FILE.read_text()) | agents(found, named), levels=5)


if __name__ == "__main__":
    run(main)
