"""Trains and measures the agents of studies of late sensors, critics and rewards: `python -m scripts.learning.train`.

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

from flexarm_agents import PPOConfig, RecurrentPPOConfig, SACConfig, StandardScore, TQCConfig, evaluate, load_policy
from flexarm_agents.environments import make_one, settings_of
from flexarm_agents.training.config import RunConfig
from flexarm_agents.training.loop import EVALUATION_SEED
from flexarm_env.laps import LAPS
from flexarm_env.validation import choice, integer
from scripts.common.command_line import read_options, run
from scripts.common.result_files import write_json
from scripts.common.study import Trial, Trials
from scripts.common.trainings import BEHIND_FILTER, curve, trained
from scripts.learning import forecast
from scripts.learning.agents import FOLDER
from scripts.learning.conditions import DELAYS

STEPS = {
    "delays": 1_000_000,
    "reward": 200_000,
}  # of the studies by the names of their data; of PPO "reward" has as tuned
PAST = (1, 2, 3, 4, 6, 8)
TRAINED = {"known": ("FlexArm/SquareDelayEasy-v0", 1), "unknown": ("FlexArm/SquareDelayMedium-v0", 3)}
WIDE = {"last_actions": 1, "randomisation": {"delay": [0.0, 0.12]}}
# Where SAC and TQC learn with the settings of `Square-v0`, and PPO where no agent of its own ships
TASKS: dict[str, dict[str, Any]] = {
    "smooth": {"environment": "FlexArm/SmoothSquare-v0"},
    "carry": {"environment": "FlexArm/Carry-v0", "evaluation_laps": 3},
    "race": {"environment": "FlexArm/Race-v0", "gamma": 0.997},
    "unknown": {"environment": "FlexArm/SquareUnknown-v0", "options": {"last_actions": 1}, "evaluation_laps": 6},
}


@dataclass
class Options:
    """Train the agents of studies of late sensors, critics and rewards, measure them, and keep that as their data."""

    only: tuple[str, ...] = ()
    """Names of agents in the data; the others' data stay. Without, all are trained."""
    seeds: int = 5
    """How many trainings of each agent."""
    jobs: int = 1
    """How many trainings run at once, on one core each."""
    output: Path = Path("results/trainings")
    """Folder for the trainings."""


def delays() -> dict[str, RunConfig]:
    """Return the configurations of agents with late sensors, by their names in the data."""
    found: dict[str, RunConfig] = {}
    for trained_at, (environment, laps) in TRAINED.items():
        own: dict[str, Any] = {"environment": environment, "evaluation_laps": laps}
        own |= {"steps": STEPS["delays"], "evaluate_every": STEPS["delays"] // 10, "options": {"last_actions": 1}}
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
    own |= {"lags": PAST, "privileged_critic": True}
    for name, options in (("unknown", {}), ("wide", {"options": WIDE})):
        found[f"{name}-privileged"] = PPOConfig(**own | options)
        found[f"{name}-automatic"] = PPOConfig(**own | options, automatic_randomisation=True)
    return found


def reward() -> dict[str, RunConfig]:
    """Return the configurations of agents that learn from the reward alone, by their names in the data."""
    off_policy = {"steps": STEPS["reward"], "evaluate_every": STEPS["reward"] // 4}
    found: dict[str, RunConfig] = {f"{task}-sac": SACConfig(**own | off_policy) for task, own in TASKS.items()}
    found |= {f"{task}-tqc": TQCConfig(**own | off_policy) for task, own in TASKS.items()}
    every = 250_000  # steps between two evaluations
    return found | {f"{task}-ppo": PPOConfig(**TASKS[task], evaluate_every=every) for task in ("smooth", "carry")}


def training(name: str, config: RunConfig, folder: Path) -> dict[str, Any]:
    """Train an agent, and measure it; see `scripts.learning.agents.Agent`.

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
    measured = {"errors": errors_by_delay(policy, config)} if name in delays() else {}
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
    studies = {"delays": delays(), "reward": reward()}
    every = {name: config for own in studies.values() for name, config in own.items()}
    named = {name: every[choice("only", name, tuple(every))] for name in given.only or every}
    seeds = range(integer("seeds", given.seeds, 1))

    def trials() -> dict[str, Trial]:
        return {
            f"{name} {seed}": partial(training, name, replace(config, seed=seed), given.output)
            for seed in seeds
            for name, config in named.items()
        }

    given.output.mkdir(parents=True, exist_ok=True)
    found = Trials("scripts.learning.train", trials)(given.output, given.jobs)
    for study, own in studies.items():
        file = FOLDER / f"{study}.json"
        kept = json.loads(file.read_text()) if file.exists() else {}
        chosen = {name: config for name, config in own.items() if name in named}
        write_json(file, kept | agents(found, chosen), levels=5)


if __name__ == "__main__":
    run(main)
