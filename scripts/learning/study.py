"""`Study`: agents that are trained with several seeds each, what stays of them, and the tables of what they come to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from flexarm_agents import Spread
from flexarm_agents.training.config import RunConfig
from scripts.common.trainings import Job, Training

FIGURES = ("rms", "rms_after_2s", "torque_change", "elbow_changes")  # of a lap's `Score`, what stays


class Record(NamedTuple):
    """What stays of a training.

    Attributes:
        seed: its seed.
        best: `FIGURES` of its best evaluation, by the lap; None for those of a lap that ended early, or not kept.
        curve: its evaluations, see `scripts.common.curves.curve`.
        measured: what the study's `measure` returned.
    """

    seed: int
    best: Mapping[str, Mapping[str, Any]]
    curve: Mapping[str, Any]
    measured: Mapping[str, Any]


class Agent(NamedTuple):
    """What stays of an agent.

    Attributes:
        config: its configuration, with any seed.
        seconds: processor time of a million steps [s]; None: the study does not ask.
        trainings: in the order of the seeds, one at least.
    """

    config: RunConfig
    seconds: float | None
    trainings: Sequence[Record]

    def spread(self, lap: str, figure: str) -> Spread:
        """Return the spread of a figure of the best evaluations over the seeds.

        Args:
            lap: name of the lap.
            figure: a name in `FIGURES`, of which less is better.
        """
        return Spread.of(one.best[lap][figure] for one in self.trainings)


Records = Mapping[str, Agent]  # by the agent's name


def nothing(training: Training, folder: Path) -> dict[str, Any]:
    """Measure nothing: best evaluation and curve are enough."""
    return {}


class Study(NamedTuple):
    """A comparison.

    Attributes:
        text: what it shows, in one line.
        agents: configurations by name, which differ in more than the seed.
        seeds: how many trainings of each, with the seeds from 0 on.
        tables: returns tables, Markdown, by name; the folder is for what is computed once and kept.
        names: of the tables.
        measure: returns plain data of a finished training, which stay when the training is gone; the folder as above.
        timed: the tables need what a million steps cost.
        picture: file made with the tables in the study's folder; "": none.
        partial: the tables can do without some of the agents, whose trainings take long.
    """

    text: str
    agents: Mapping[str, RunConfig]
    seeds: int
    tables: Callable[[Records, Path], Mapping[str, str]]
    names: tuple[str, ...]
    measure: Callable[[Training, Path], dict[str, Any]] = nothing
    timed: bool = False
    picture: str = ""
    partial: bool = False


def jobs_of(study: Study, seeds: int, folder: Path) -> list[Job]:
    """Return the trainings of a study, the first seed of each agent first.

    Args:
        study: the comparison.
        seeds: how many of each agent.
        folder: holds a folder for each agent.
    """
    return [
        (replace(config, seed=seed), folder / name / f"seed-{seed}")
        for seed in range(seeds)
        for name, config in study.agents.items()
    ]


def by_agent(found: Sequence[Training]) -> dict[str, list[Training]]:
    """Sort finished trainings by the names of their agents."""
    sorted_out: dict[str, list[Training]] = {}
    for one in found:
        sorted_out.setdefault(one.folder.parent.name, []).append(one)
    return sorted_out
