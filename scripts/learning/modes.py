"""What learning adds to classical control: torques beside a joint-space law, or shifts of that law's reference."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from flexarm_agents import Spread, TrainingConfig
from flexarm_agents.board.columns import Point
from flexarm_agents.board.episodes import run_points
from flexarm_agents.board.rows import Row
from flexarm_agents.board.summary import merged
from flexarm_env.envs.registration import UNKNOWN_PLANT
from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.common.spreads import millimetres, spread_text
from scripts.common.trainings import Training
from scripts.learning.study import Records, Study

RESIDUAL = "FlexArm/SquareResidual-v0"
REFERENCE: dict[str, Any] = {"action_mode": "reference"}
STEPS = 500_000
# Unknown arms without the motors' delay, which is a whole number of periods where the reference is shifted.
DRAWN = {
    **UNKNOWN_PLANT,
    "randomisation": {name: x for name, x in UNKNOWN_PLANT["randomisation"].items() if name != "actuation_delay"},
}
NOMINAL = Point("nominal")
PARTS = tuple(Point(str(n), DRAWN, seeds=range(n, n + 16), paired=False) for n in range(0, 64, 16))
TEXTS = {
    "residual": f"torques added to it, learned (PPO, {STEPS:,} steps)",
    "reference": f"shifts of its reference, learned (PPO, {STEPS:,} steps)",
    "torque": "no law: torques, learned (PPO, shipped `square`)",
}


class LawAlone:
    """The action 0: the joint-space law without a learner."""

    batched: ClassVar[bool] = True

    def predict(self, observation: Any) -> NDArray[np.float32]:
        """Return zeros, for one observation or a batch."""
        return np.zeros((*np.shape(observation)[:-1], 2), dtype=np.float32)


def measure(training: Training, folder: Path) -> dict[str, Any]:
    """Return the errors of the nominal laps and of each drawn plant [m]; None for a lost one."""
    return measured(Row(str(training.folder)))


def measured(row: Row) -> dict[str, Any]:
    """Return what `measure` does, of any row."""
    return {
        name: [_rms(one) for one in _episodes(row, points)]
        for name, points in (("nominal", [NOMINAL]), ("drawn", PARTS))
    }


def tables(agents: Records, folder: Path) -> Mapping[str, str]:
    """Write the table of this study: nominal laps and drawn plants, with mean and worst episode."""
    drawn = f"{sum(len(part.episodes) for part in PARTS)} drawn plants"
    head = ("action", "seeds", *(f"{lap} lap [mm]" for lap in LAPS), f"{drawn}: lost", "mean [mm]", "worst [mm]")
    several: dict[str, list[Mapping[str, Any]]] = {
        "the joint-space law alone": [measured(Row(f"{__name__}:{LawAlone.__name__}", "alone", RESIDUAL))]
    }
    several |= {TEXTS[name]: [one.measured for one in agents[name].trainings] for name in ("residual", "reference")}
    several[TEXTS["torque"]] = [measured(Row("square"))]
    return {"action_modes": table(head, [_line(text, found) for text, found in several.items()])}


def _line(text: str, found: Sequence[Mapping[str, Sequence[float | None]]]) -> tuple[str, ...]:
    """Write the spread of the trainings in every cell; mean and worst are of the episodes that are complete."""
    lost: list[float | None] = []
    drawn: list[tuple[float | None, float | None]] = []
    for one in found:
        whole = [error for error in one["drawn"] if error is not None]
        lost.append(len(one["drawn"]) - len(whole))
        drawn.append((float(np.mean(whole)), max(whole)) if whole else (None, None))
    nominal = zip(*(one["nominal"] for one in found), strict=True)
    errors = [millimetres(Spread.of(several)) for several in (*nominal, *zip(*drawn, strict=True))]
    count = spread_text(Spread.of(lost), 0)
    return (text, str(len(found)), *errors[: len(LAPS)], count, *errors[len(LAPS) :])


def _episodes(row: Row, points: Sequence[Point]) -> list[dict[str, Any]]:
    """Return the episodes of a row at some points.

    Raises:
        ValueError: if the row cannot be run there.
    """
    whole = merged(run_points(row, points))
    if whole is None or "not_applicable" in whole:
        raise ValueError(f"row {row.name}: {whole}")
    found: list[dict[str, Any]] = whole["episodes"]
    return found


def _rms(episode: Mapping[str, Any]) -> float | None:
    """Return the error of a complete episode [m]; None for a lost one."""
    return None if episode["figures"] is None else float(episode["figures"]["rms"])


STUDY = Study(
    "what learning adds to a joint-space law: r.m.s. error",
    {
        "residual": TrainingConfig(environment=RESIDUAL, steps=STEPS),
        "reference": TrainingConfig(options=REFERENCE, steps=STEPS),
    },
    11,
    tables,
    ("action_modes",),
    measure,
)
