"""`Study`: agents that are trained with several seeds each, and the tables of what they come to."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

from flexarm_agents import Score, Spread, StandardScore
from flexarm_agents.config import RunConfig
from scripts.common.trainings import Job, Training

Found = Mapping[str, Sequence[Training]]  # by the agent's name, in the order of the seeds


class Study(NamedTuple):
    """A comparison.

    Attributes:
        text: what it shows, in one line.
        agents: configurations by name, which differ in more than the seed.
        seeds: how many trainings of each, with the seeds from 0 on.
        tables: returns tables, Markdown, by name; the folder is for what is computed once and kept.
        names: of the tables.
        pictures: files made with the tables in the study's folder, and where the page has them; data of pictures, too.
        partial: the tables can do without some of the agents, whose trainings take long.
        curves: name of the files that have its training curves, see `keep_curves`.
    """

    text: str
    agents: Mapping[str, RunConfig]
    seeds: int
    tables: Callable[[Found, Path], Mapping[str, str]]
    names: tuple[str, ...]
    pictures: Mapping[str, Path] = MappingProxyType({})
    partial: bool = False
    curves: str = "curves"


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


def lap_spread(trainings: Sequence[Training], lap: str, figure: str) -> Spread:
    """Return the spread of a lap's figure over trainings; an early end counts as infinite."""
    laps: list[Score] = [getattr(StandardScore.of(one.best), lap) for one in trainings]
    return Spread.of(getattr(one, figure) for one in laps)
