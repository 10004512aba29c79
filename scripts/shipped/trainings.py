"""Trainings with several seeds, the median one of them, and its files in the package."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from math import isclose
from pathlib import Path
from typing import Any, NamedTuple

from flexarm_agents import StandardScore, TeachingConfig, TrainingConfig, evaluate, load_policy
from flexarm_agents.config import RunConfig
from flexarm_agents.evaluation import EVALUATION_SEED
from flexarm_agents.run_folder import RunFolder, put, write_json
from flexarm_agents.score import rank
from flexarm_agents.teaching.training import teach
from flexarm_agents.training import Outcome, train
from scripts.common.worker_pool import worker_pool

ROUNDING = 1e-3  # relative, of a lap's error
RULE = "the median of {count} trainings that differ in their seeds, by the mean r.m.s. of both laps"


class Training(NamedTuple):
    """A finished training.

    Attributes:
        config: its configuration.
        folder: where it lies.
        best: the evaluation of its best policy, a row of `evaluations.json`.
    """

    config: RunConfig
    folder: Path
    best: dict[str, Any]


def trained(config: RunConfig, folder: Path) -> Training:
    """Train, go on with an interrupted training, or take a finished one over.

    Args:
        config: the configuration.
        folder: for the results.

    Raises:
        ValueError: the training in the folder has another configuration, or was made by a version whose environments
            gave other scores.
    """
    outcome = carried_out(config, folder)
    policy = load_policy(folder)
    again = evaluate(policy.make_env(), policy.policy, EVALUATION_SEED)
    if policy.notes["config"]["evaluation_laps"] == 1 and not _alike(again, StandardScore.of(outcome.best)):
        raise ValueError(
            f"folder = {folder}: its best policy scored {StandardScore.of(outcome.best)}, and now {again}; another "
            "version trained it, so remove the folder"
        )
    return Training(config, folder, outcome.best)


def _alike(one: StandardScore, other: StandardScore) -> bool:
    """Return whether two scores differ at most as a version that rounds otherwise makes them differ."""
    errors = [(a.rms, b.rms) for a, b in zip(one, other, strict=True)]
    return all(a is b is None or (a and b and isclose(a, b, rel_tol=ROUNDING)) for a, b in errors)


def carried_out(config: RunConfig, folder: Path) -> Outcome:
    """Train, or go on, by the kind of the configuration; students of one agent share their teacher's plans.

    Raises:
        TypeError: for another kind.
    """
    resume = RunFolder(folder).config.exists()
    if isinstance(config, TeachingConfig):
        return teach(config, folder, resume, plans=folder.parent / "plans")
    if isinstance(config, TrainingConfig):
        return train(config, folder, resume)
    raise TypeError(f"config = {config!r}: must be a TrainingConfig or a TeachingConfig")


def trained_all(configs: Sequence[RunConfig], output: Path, jobs: int) -> list[Training]:
    """Train each configuration in a folder of its own, on one core each.

    Args:
        configs: which differ in their seeds.
        output: holds the folders.
        jobs: how many trainings run at once.
    """
    output.mkdir(parents=True, exist_ok=True)
    with worker_pool(jobs) as pool:
        futures = [pool.submit(trained, config, output / f"seed-{config.seed}") for config in configs]
        return [future.result() for future in futures]


def median(trainings: Sequence[Training]) -> Training:
    """Return the training whose best policy is in the middle, by `score.rank`.

    Args:
        trainings: an odd number.

    Raises:
        ValueError: for an even number.
    """
    if len(trainings) % 2 == 0:
        raise ValueError(f"trainings: must be an odd number, so that one is in the middle; got {len(trainings)}")
    ranked = sorted(trainings, key=lambda one: rank([StandardScore.of(one.best)]))
    return ranked[len(ranked) // 2]


def export(trainings: Sequence[Training], policies: Path, name: str, command: str) -> None:
    """Put the median training's best policy into the package, with its card beside it.

    Args:
        trainings: all of them; the card has the scores of each.
        policies: the package's folder of policies.
        name: name of the shipped policy.
        command: what made it.
    """
    chosen = median(trainings)
    put(policies / f"{name}.npz", lambda aside: shutil.copyfile(RunFolder(chosen.folder).best, aside))
    card = {
        "command": command,
        **load_policy(policies / f"{name}.npz").notes,
        "choice": RULE.format(count=len(trainings)),
        "trainings": [{"seed": one.config.seed, **one.best} for one in trainings],
    }
    write_json(policies / f"{name}.json", card)
