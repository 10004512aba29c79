"""What scheduling the gain of the paper's law can give: fuzzy, constant, learned, and with perfect foresight."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from flexarm_agents import Score, TrainingConfig
from flexarm_agents.environments import make_one
from flexarm_baselines import FLSAC, IFDC
from flexarm_env.envs.registration import IDS
from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.common.spreads import millimetres
from scripts.learning.foresight import CONSTANTS, LEVELS, Plant, Schedule, Search, constant_errors, kept_search
from scripts.learning.study import Records, Study

GAIN = "FlexArm/SquareGain-v0"
# The plant of `Paper-v0`, with its gain set 100 times a second and the observation of `Square-v0`.
_PLANT = ("arm", "law_sensor", "sensor", "deflection_limit", "error_limit")
PAPER: dict[str, Any] = {name: IDS["Paper-v0"].options[name] for name in _PLANT} | {"physics_step": None}
PLANTS = {"square": Plant(GAIN, {}), "paper": Plant(GAIN, PAPER)}
TEXTS = {"square": "`SquareGain-v0`", "paper": "the paper's plant"}
STEPS = 500_000


def rows(agents: Records, folder: Path) -> Iterator[tuple[str, ...]]:
    """Yield the lines of the table: each scheduler on each plant."""
    for name, plant in PLANTS.items():
        env = make_one(plant.environment, plant.options)
        for text, law in (("IFDC, gain 1", IFDC.for_env(env)), ("FLSAC", FLSAC.for_env(env))):
            yield TEXTS[name], text, "-", *_cells({lap: plant.score(law, lap) for lap in LAPS})
        errors = {lap: constant_errors(plant, lap) for lap in LAPS}
        best = CONSTANTS[int(np.argmin(sum(errors.values())))]
        constant = IFDC.for_env(env, gain=best)
        yield TEXTS[name], f"best constant, {best:g}", "-", *_cells({lap: plant.score(constant, lap) for lap in LAPS})
        env.close()
        spreads = [agents[name].spread(lap, figure) for lap in LAPS for figure in ("rms", "rms_after_2s")]
        seeds = str(len(agents[name].trainings))
        yield TEXTS[name], f"learned (PPO, {STEPS:,} steps)", seeds, *map(millimetres, spreads)
        searches = _searches(name, plant, folder)
        last = {lap: Schedule(searches[lap].knots[-1], plant.periods) for lap in LAPS}
        cells = _cells({lap: plant.score(last[lap], lap) for lap in LAPS})
        yield TEXTS[name], f"perfect foresight, {LEVELS[-1] + 1} gains", "-", *cells


def knots(folder: Path) -> str:
    """Tabulate the error of the schedule with perfect foresight by its number of knots."""
    lines = []
    for name, plant in PLANTS.items():
        searches, periods = _searches(name, plant, folder), plant.periods
        for lap, found in searches.items():
            several = [Schedule((found.constant,) * 2, periods), *(Schedule(one, periods) for one in found.knots)]
            laps = [plant.score(one, lap) for one in several]
            lines.append((TEXTS[name], lap, *(millimetres(one.rms) for one in laps)))
    return table(("plant", "lap", "constant", *(f"{level + 1} gains" for level in LEVELS)), lines)


def tables(agents: Records, folder: Path) -> Mapping[str, str]:
    """Write the tables of this study."""
    errors = [f"{lap}: {figure} [mm]" for lap in LAPS for figure in ("lap", "after 2 s")]
    head = ("plant", "scheduler", "seeds", *errors)
    return {"schedulers": table(head, rows(agents, folder)), "foresight": knots(folder)}


def _searches(name: str, plant: Plant, folder: Path) -> dict[str, Search]:
    return {lap: kept_search(plant, lap, folder / "foresight" / f"{name}-{lap}.json") for lap in LAPS}


def _cells(laps: Mapping[str, Score]) -> tuple[str, ...]:
    return tuple(millimetres(error) for one in laps.values() for error in (one.rms, one.rms_after_2s))


STUDY = Study(
    "what scheduling the gain of the paper's law can give: r.m.s. error",
    {
        name: TrainingConfig(environment=plant.environment, options=dict(plant.options), steps=STEPS)
        for name, plant in PLANTS.items()
    },
    11,
    tables,
    ("schedulers", "foresight"),
)
