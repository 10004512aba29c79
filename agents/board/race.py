"""The figures of the task "race": the times of the first lap, of the fastest, and of all three."""

from __future__ import annotations

from typing import Any

from flexarm_agents.board.figures import ERRORS, Figure, Record, of_lap

FIGURES = {
    "three_laps": Figure("time of three laps from rest, within 0.25 m of the reference", "s", "three laps"),
    "fastest_lap": Figure("time of the fastest of them", "s", "fastest lap"),
    "first_lap": Figure("time of the first of them", "s", "first lap"),
    "maximum": ERRORS["maximum"],
}
RECORDED = ("lap_times",)  # infos that `of_race` reads
COMPLETE = ("finished",)


def of_race(view: Any, record: Record) -> dict[str, Any]:
    """Return the figures of a race that was finished, `FIGURES` among them; see `figures.of_lap`."""
    first, fastest, whole = record["lap_times"][-1].tolist()
    return of_lap(view, record) | {"three_laps": whole, "fastest_lap": fastest, "first_lap": first}
