"""Trainings as jobs of any executor: each is started, resumed, or reused where it is finished."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from math import isclose
from pathlib import Path
from typing import Any, NamedTuple

from flexarm_agents import DAggerConfig, StandardScore, evaluate, load_policy
from flexarm_agents.environments import settings_of
from flexarm_agents.evaluation.races import read_score
from flexarm_agents.jobs.executors import Executor
from flexarm_agents.jobs.failures import Failure
from flexarm_agents.training.config import RunConfig
from flexarm_agents.training.loop import EVALUATION_SEED
from flexarm_agents.training.run_folder import RunFolder
from flexarm_agents.training.train import train
from flexarm_env.laps import LAPS

ROUNDING = 1e-3  # relative, of a lap's error
Job = tuple[RunConfig, Path]


class Training(NamedTuple):
    """A finished training."""

    config: RunConfig  # its configuration
    folder: Path  # where it lies
    best: dict[str, Any]  # the evaluation of its best policy, a row of `evaluations.json`

    @property
    def score(self) -> StandardScore:
        """The score of its best policy."""
        return read_score(self.best, settings_of(self.config.environment, self.config.options).mode.races)


def trained(config: RunConfig, folder: Path) -> Training:
    """Train, resume an interrupted training, or reuse a finished one that this version scores alike.

    Students of one agent share their teacher's plans.
    """
    given = replace(config, plans=str(folder.parent / "plans")) if isinstance(config, DAggerConfig) else config
    outcome = train(given, folder, resume=RunFolder(folder).config.exists())
    policy = load_policy(folder)
    again = evaluate(policy.make_env(), policy.policy, EVALUATION_SEED)
    found = Training(config, folder, outcome.best)
    if policy.notes["config"]["evaluation_laps"] == 1 and not _alike(again, found.score):
        raise ValueError(
            f"folder = {folder}: its best policy scored {found.score}, and now {again}; another version trained it, so "
            "remove the folder"
        )
    return found


def curve(rows: Sequence[Mapping[str, Any]], figure: str = "rms") -> dict[str, Any]:
    """Return what evaluations found: steps, seconds where known, each lap's figure to five digits, None if lost."""
    found: dict[str, Any] = {name: [row[name] for row in rows] for name in ("steps", "seconds") if name in rows[0]}
    laps = {lap: [one[lap][figure] if one[lap]["complete"] else None for one in rows] for lap in LAPS}
    return found | {lap: [one and float(f"{one:.5g}") for one in several] for lap, several in laps.items()}


def _alike(one: StandardScore, other: StandardScore) -> bool:
    """Return whether two scores differ at most as a version that rounds otherwise makes them differ."""
    pairs = [(a.complete, b.complete, a.rank[1], b.rank[1]) for a, b in zip(one, other, strict=True)]
    return all(a == b and (not a or isclose(x, y, rel_tol=ROUNDING)) for a, b, x, y in pairs)


def trained_all(jobs: Sequence[Job], where: Executor, tick: Callable[[], Any]) -> tuple[list[Training], list[Failure]]:
    """Train each configuration in a folder of its own; return those that finished, in order, and the failures.

    When this process is stopped, each training that runs finishes its rollout and keeps a checkpoint.
    """
    found: dict[int, Training] = {}
    failed = []
    for n, outcome in where.run(_trained, jobs, stoppable=True) if jobs else ():
        if isinstance(outcome, BaseException):
            failed.append(Failure(str(jobs[n][1]), outcome))
        else:
            found[n] = outcome
        tick()
    return [found[n] for n in sorted(found)], failed


def _trained(job: Job) -> Training:
    return trained(*job)
