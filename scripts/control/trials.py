"""What a table's row is made from: a controller of the registry with its design, on both standard laps."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from flexarm_agents.evaluation.candidates import ENVIRONMENT, from_controller
from flexarm_agents.evaluation.scoring import Score, StandardScore, evaluate
from flexarm_agents.jobs.worker_pool import worker_pool

ERRORS = ("swing lap [mm]", "plain lap [mm]")  # see `cell`


@dataclass(frozen=True)
class Trial:
    """A controller on both laps.

    Attributes:
        controller: its name in the registry.
        design: keyword arguments of its `for_env`.
        options: options of the environment, beside those that the controller needs.
        environment: id.
        seed: of what is random in the environment.
    """

    controller: str
    design: Mapping[str, Any] = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    environment: str = ENVIRONMENT
    seed: int = 0

    def score(self) -> StandardScore:
        """Run both laps."""
        candidate = from_controller(self.controller, self.environment, self.options, **self.design)
        try:
            return evaluate(candidate.env, candidate.policy, self.seed)
        finally:
            candidate.env.close()


Trials = dict[str, Trial]  # by a label
Scores = dict[str, StandardScore]


class Scored(Protocol):
    """What a trial comes to."""

    def as_mapping(self) -> dict[str, Any]:
        """Return a mapping of plain values for a file."""


class Runnable(Protocol):
    """A trial of any kind."""

    def score(self) -> Scored:
        """Run it."""


class Study(NamedTuple):
    """A table with what it is made from.

    Attributes:
        text: what it shows, in one line.
        trials: returns what is run; with True, a few for a trial of the script.
        table: writes the table, Markdown, of the trials' scores.
        page: of docs/ that shows it.
    """

    text: str
    trials: Callable[[bool], Mapping[str, Runnable]]
    table: Callable[[Any], str]
    page: str = "controllers.md"


def scores_of(trials: Mapping[str, Runnable], jobs: int, tick: Callable[[str], object]) -> dict[str, Scored]:
    """Score trials, in their order.

    Args:
        trials: by label.
        jobs: processes; 1: this one.
        tick: called with the label of each that is done.
    """
    found: dict[str, Scored] = {}
    if jobs == 1:
        for label, trial in trials.items():
            found[label] = trial.score()
            tick(label)
        return found
    with worker_pool(jobs) as pool:
        futures = {label: pool.submit(_run, trial) for label, trial in trials.items()}
        for label, future in futures.items():
            found[label] = future.result()
            tick(label)
    return found


def _run(trial: Runnable) -> Scored:
    """Run a trial, in a worker."""
    return trial.score()


def errors(score: StandardScore) -> list[str]:
    """Write the cells of `ERRORS`."""
    return [cell(score.swing), cell(score.plain)]


def cell(lap: Score, digits: int = 0) -> str:
    """Write r.m.s. over a lap / after 2 s [mm], or when it was lost."""
    if lap.rms is None or lap.rms_after_2s is None:
        return f"lost at {lap.duration:.1f} s"
    return f"{1e3 * lap.rms:.{digits}f} / {1e3 * lap.rms_after_2s:.{digits}f}"
