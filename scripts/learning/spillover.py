"""Whether agents that learned on an arm of two shapes a link can drive arms with more, and the chain."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from flexarm_agents import Spread, TrainingConfig
from flexarm_agents.board.columns import COLUMNS
from flexarm_agents.board.rows import Row
from flexarm_env.envs.registration import UNKNOWN_PLANT
from scripts.common.markdown import table
from scripts.common.spreads import millimetres
from scripts.learning.measured import errors_at, mean_of_laps, measure_at
from scripts.learning.study import Records, Study

STEPS = 1_000_000
POINTS = tuple(
    point for point in COLUMNS["model"].points if point.value in ("2 shapes", "3 shapes", "4 shapes", "chain")
)
HIGH = {name: list(UNKNOWN_PLANT["randomisation"][name]) for name in ("stiffness", "damping")}
RANDOMISATIONS: dict[str, dict[str, Any]] = {"fixed": {}, "drawn": {"randomisation": HIGH}}
TEXTS = {
    "fixed": "PPO, trained on two shapes",
    "drawn": "PPO, trained on two shapes, stiffness and damping drawn",
}
YARDSTICKS = {"lqg": "`lqg`, designed on three shapes", "student": "student on three shapes (`student`)"}


def tables(agents: Records, folder: Path) -> Mapping[str, str]:
    """Write the table of this study: mean error of both laps on each arm."""
    several = {text: [errors_at(Row(source), POINTS, folder / "cells")] for source, text in YARDSTICKS.items()}
    several |= {TEXTS[name]: [one.measured["errors"] for one in agent.trainings] for name, agent in agents.items()}
    lines = []
    for text, errors in several.items():
        means = [[mean_of_laps(one, n) for one in errors] for n in range(len(POINTS))]
        lines.append((text, str(len(errors)), *(millimetres(Spread.of(values)) for values in means)))
    return {"spillover": table(("agent", "seeds", *(f"{point.value} [mm]" for point in POINTS)), lines)}


STUDY = Study(
    "arms of more shapes than in training: mean r.m.s. error of both laps",
    {
        name: TrainingConfig(
            environment="FlexArm/SquareDelayEasy-v0",
            options={"arm": {"modes_per_link": 2}, **more},
            steps=STEPS,
            evaluate_every=STEPS // 10,
            evaluation_laps=3 if more else 1,
        )
        for name, more in RANDOMISATIONS.items()
    },
    10,
    tables,
    ("spillover",),
    measure_at(POINTS),
    partial=True,
)
