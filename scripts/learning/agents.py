"""The data of finished studies: what stays of each agent's trainings, and of the controllers beside them."""

import json
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexarm_agents import Spread
from flexarm_agents.board.measure import PUBLISHED
from flexarm_env.laps import LAPS
from scripts.common.markdown import DOCS, millimetres

FOLDER = DOCS / "figures" / "agents"


class Agent(NamedTuple):
    """What stays of an agent."""

    # Of its trainings, but for the seed; None: a controller, or an agent of another study
    config: Mapping[str, Any] | None
    seconds: float | None  # processor time of a million steps [s], where it was measured
    # With the `seed`; figures of the `best` evaluation by the lap; the `curve` of all evaluations; what else was
    # `measured`
    trainings: Sequence[Mapping[str, Any]]

    @property
    def seeds(self) -> str:
        """Number of trainings, as tables have it."""
        return str(len(self.trainings))

    def spread(self, lap: str) -> Spread:
        """Return the spread of the best evaluations' r.m.s. error over the seeds."""
        return Spread.of(one["best"][lap]["rms"] for one in self.trainings)

    def measured(self, name: str) -> list[Any]:
        """Return what was measured of each training."""
        return [one["measured"][name] for one in self.trainings]

    def error_at(self, point: int) -> str:
        """Write the spread of the mean error of both laps at a point of "errors" [mm]."""
        several = ([errors[lap][point] for lap in LAPS] for errors in self.measured("errors"))
        return millimetres(Spread.of(None if None in one else float(np.mean(one)) for one in several))


Agents = Mapping[str, Agent]  # by their names


def committed(
    study: str, beside: Collection[str] = (), points: Sequence[tuple[str, Any]] = ()
) -> Callable[[Path, int], dict[str, Agent]]:
    """Return a study's `results`, which are read from a file of `FOLDER`.

    Those of controllers and shipped agents beside them are the leaderboard's: "errors" at points, which are columns of
    the board and values there.
    """

    def results(folder: Path, jobs: int) -> dict[str, Agent]:
        found = {name: Agent(**one) for name, one in json.loads((FOLDER / f"{study}.json").read_text()).items()}
        board = json.loads(PUBLISHED.read_text())
        rows = {row["name"].removeprefix("agent "): row["columns"] for row in board["rows"]}
        for name in beside:
            each = [rows[name][axis]["points"][board["columns"][axis]["values"].index(value)] for axis, value in points]
            errors = {lap: [one[lap]["rms"] and one[lap]["rms"]["mean"] for one in each] for lap in LAPS}
            found[name] = Agent(None, None, [{"measured": {"errors": errors}}])
        return found

    return results
