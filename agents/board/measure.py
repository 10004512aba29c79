"""The board: cells that are missing are computed, and all are added up, to JSON and tables."""

from __future__ import annotations

import platform
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from flexarm_agents.board.cells import Cell, Store, compute, jobs_of
from flexarm_agents.board.columns import COLUMNS, Column
from flexarm_agents.board.entries import Entry, all_entries
from flexarm_agents.board.summary import entry_summary
from flexarm_agents.board.tables import tables
from flexarm_agents.board.terms import BOARD, TASKS
from flexarm_agents.files import write_json, write_text
from flexarm_agents.jobs.executors import Executor
from flexarm_agents.jobs.failures import Failure
from flexarm_baselines import IFDC
from flexarm_env.analysis import delay_margin, law_loop
from flexarm_env.envs.settings import Settings
from flexarm_env.parameters import SquareParameters
from flexarm_env.physics.paths import square
from flexarm_env.validation import choice

DATA = "leaderboard.json"
INCOMPLETE = "their entries lack cells, the cells that were computed are kept"  # after a failure
PLACES = 5  # of a margin, on half a side of the square; the other sides repeat it
DIGITS = 6  # of the figures in the board's file


def chosen_entries(names: Sequence[str], without: Sequence[str] = (), added: Sequence[str] = ()) -> list[Entry]:
    """Return entries by their names, without some; those that are added need no name."""
    entries, own = all_entries(added), [entry.name for entry in all_entries(())]
    for what, given in (("entries", names), ("without", without)):
        for name in given:
            choice(what, name, tuple(entry.name for entry in entries))
    wanted = [entry for entry in entries if not names or entry.name in names or entry.name not in own]
    return [entry for entry in wanted if entry.name not in without]


def chosen_columns(names: Sequence[str]) -> dict[str, Column]:
    """Return columns by their names."""
    for name in names:
        choice("columns", name, tuple(COLUMNS))
    return {name: column for name, column in COLUMNS.items() if name in names}


def measure(
    entries: Sequence[Entry],
    columns: Mapping[str, Column],
    store: Store,
    where: Executor,
    progress: Callable[[int], tqdm[Any]] = lambda total: tqdm(total=total, disable=True),
) -> tuple[dict[str, Any], list[Failure]]:
    """Compute the missing cells; return the board of the entries that have all, and the jobs that failed."""
    cells = {
        entry.name: {name: [Cell.of(entry, point) for point in column.points] for name, column in columns.items()}
        for entry in entries
    }
    wanted = [cell for own in cells.values() for column in own.values() for cell in column]
    missing = store.missing(wanted)
    jobs, failed = jobs_of(missing), []
    with progress(len(missing)) as bar:
        for n, outcome in where.run(compute, jobs) if jobs else ():
            if isinstance(outcome, BaseException):
                failed.append(Failure(jobs[n][0].entry.name, outcome))
            else:
                for cell, result in zip(jobs[n], outcome, strict=True):
                    store.write(cell, result)
            bar.update(len(jobs[n]))
    whole = {
        entry.name: {name: list(map(store.read, column)) for name, column in cells[entry.name].items()}
        for entry in entries
    }
    found = [
        entry_summary(entry, columns, whole[entry.name]) | {"delay_margin": delay_margins(entry)}
        for entry in entries
        if all(one is not None for column in whole[entry.name].values() for one in column)
    ]
    return board(found, columns), failed


def board(entries: Sequence[Mapping[str, Any]], columns: Mapping[str, Column]) -> dict[str, Any]:
    """Put entries together to a board, as plain values."""
    names = ("flexarm", "gymnasium", "numpy", "numba", "scipy")
    return {
        "board": BOARD,
        "versions": {"python": platform.python_version(), **{name: version(name) for name in names}},
        "references": TASKS["square"].best(),
        "tasks": {
            name: {"figures": {key: one._asdict() for key, one in task.figures.items()}, "best": task.best()}
            for name, task in TASKS.items()
        },
        "columns": {
            name: {
                "title": column.title,
                "unit": column.unit,
                "values": [point.value for point in column.points],
                "tasks": [point.task for point in column.points],
                "nominal": column.nominal,
            }
            for name, column in columns.items()
        },
        "rows": list(entries),
    }


def write(results: Mapping[str, Any], folder: Path) -> None:
    """Write the board's JSON and tables into a folder, which is made."""
    folder.mkdir(parents=True, exist_ok=True)
    write_json(folder / DATA, rounded(results), levels=5)
    for name, text in tables(results).items():
        write_text(folder / f"{name}.md", text)


def rounded(value: Any) -> Any:
    """Round figures for the board's file; cells have all digits."""
    if isinstance(value, dict):
        return {name: rounded(one) for name, one in value.items()}
    if isinstance(value, list):
        return [rounded(one) for one in value]
    return float(f"{value:.{DIGITS}g}") if isinstance(value, float) else value


def delay_margins(entry: Entry) -> Mapping[str, float] | None:
    """Return the "least" and "most" delay margin [s] along the square, by the linear theory of an arm at rest.

    None for an entry whose loop is not linear, or does not contain the sensor.
    """
    candidate = entry.candidate()
    settings: Any = candidate.env.unwrapped.settings  # type: ignore[attr-defined]
    assert isinstance(settings, Settings)
    if not isinstance(candidate.policy, IFDC) or settings.feedback_source != "sensor":
        return None
    path = square(SquareParameters())
    places = path.position(np.linspace(0.0, path.lap_time / 8.0, PLACES))
    # the axis has one delay for both joints
    sensor = replace(settings.sensor_parameters, delay=max(settings.sensor_delays))
    gain = candidate.policy.gain
    loops = [law_loop(settings.flexible_arm, place, sensor, gain) for place in places]
    found = [delay_margin(loop).delay for loop in loops]
    return {"least": min(found), "most": max(found)}
