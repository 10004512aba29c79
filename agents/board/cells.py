"""Cells: what is computed once and kept, one file each, by a hash of all that its result depends on.

A key is the hash of the policy (data and code), the environment's whole settings with its physics step, the episodes,
and the code of the simulation. A changed policy makes only its own cells stale; a commit that touches none of these
makes no cell stale. A file that is there is complete.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, fields
from functools import lru_cache
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple, Self

from flexarm_agents.board.columns import Point
from flexarm_agents.board.entries import Entry
from flexarm_agents.board.episodes import run_points, shares
from flexarm_agents.board.terms import TASKS
from flexarm_agents.code_version import code_version
from flexarm_agents.files import write_text
from flexarm_env.envs.registration import ChainOptions
from flexarm_env.envs.settings import Settings
from flexarm_env.parameters import arm_parameters
from flexarm_env.validation import short, shown

FORMAT = 2
# Modules that the simulation imports and that do not affect a result: those that show, document, declare or check
# options (a key holds the options' values), and derivatives, which only controllers use.
WITHOUT_PART = (
    *(f"flexarm_env.envs.{name}" for name in ("documentation", "drawing", "rendering", "scene", "warm_up")),
    *(f"flexarm_env.envs.{name}" for name in ("registration", "options", "motion_options")),
    *("flexarm_env.envs.choices", "flexarm_env.envs.consistency"),
    *("flexarm_env.formulas", "flexarm_env.allowed", "flexarm_env.validation"),
    *("flexarm_env.kernels.step_jacobians", "flexarm_env.kernels.rk4", "flexarm_env.codegen.tangents"),
    *("flexarm_env.simulation.held_torque", "flexarm_env.simulation.feedback", "flexarm_env.simulation.open_loop"),
    *(f"flexarm_agents.board.{name}" for name in ("entries", "columns", "terms")),
)
_SIMULATION = ("flexarm_agents.board.episodes",)
_CHAIN = ("flexarm_env.chain.env",)


class Cell(NamedTuple):
    """An entry at a point."""

    entry: Entry  # the policy that is measured
    point: Point  # where
    depends: dict[str, Any]  # all that the result depends on, as plain values

    @classmethod
    def of(cls, entry: Entry, point: Point) -> Self:
        """Return the cell with all that its result depends on; the entry must be able to do its home task."""
        return cls(entry, point, {"policy": dict(entry.fingerprint), **_environment(entry, point)})

    @property
    def key(self) -> str:
        """Name of its file."""
        return _content_hash(self.depends)


def _content_hash(*values: Any) -> str:
    text = "\n".join(json.dumps(one, sort_keys=True, allow_nan=False) for one in values)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _environment(entry: Entry, point: Point) -> dict[str, Any]:
    options = point.environment_options(entry.interface)
    task = TASKS[point.task]
    code = _code(task.hosted, task.measure.__module__)
    episodes = [list(one) for one in point.seeded(entry.content)]
    try:
        settings = Settings.of(options)
    except (TypeError, ValueError) as error:  # the result says so, too
        return {"code": code, "refused": str(error), "episodes": episodes}
    values = {one.name: getattr(settings, one.name) for one in fields(Settings) if one.name != "reward_weights"}
    values["arm"] = asdict(arm_parameters(settings.arm))
    values["physics_step"] = settings.control_period / settings.substeps
    if task.hosted:
        values |= asdict(ChainOptions())
    plain = json.loads(json.dumps(values))
    return {"code": code, "settings": plain, "task": point.task, "episodes": episodes}


@lru_cache
def _code(hosted: bool, measure: str) -> str:
    return code_version([*_SIMULATION, measure, *(_CHAIN if hosted else ())], WITHOUT_PART)


class Store:
    """A folder of cells, which is made when the first one is written."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, key: str) -> Path:
        """Return the file of a cell."""
        return self.folder / key[:2] / f"{key}.json"

    def read(self, cell: Cell) -> dict[str, Any] | None:
        """Return a cell's result; None if it is not there.

        Raises:
            ValueError: if the file is damaged, of another format, or not a cell's.
        """
        path = self.path(cell.key)
        try:
            content = json.loads(path.read_text(encoding="utf-8"))
            if content["format"] != FORMAT:
                raise ValueError(f"format = {shown(content['format'])}: must be {FORMAT}")
            if content["hash"] != _content_hash(cell.depends, content["result"]):
                raise ValueError("it is damaged")
            result: dict[str, Any] = content["result"]
        except FileNotFoundError:
            return None
        except (ValueError, KeyError, TypeError, RecursionError) as error:
            raise ValueError(f"{path}: is no cell; remove it ({short(str(error))})") from error
        return result

    def missing(self, cells: Iterable[Cell]) -> list[Cell]:
        """Return the cells that are not there, each key once."""
        wanted = {cell.key: cell for cell in cells}
        return [cell for key, cell in wanted.items() if not self.path(key).is_file()]

    def write(self, cell: Cell, result: Mapping[str, Any]) -> None:
        """Write a cell; the file is complete or absent."""
        path = self.path(cell.key)
        path.parent.mkdir(parents=True, exist_ok=True)
        own_hash = _content_hash(cell.depends, result)
        content = {"format": FORMAT, "depends": cell.depends, "result": result, "hash": own_hash}
        write_text(path, json.dumps(content, allow_nan=False, sort_keys=True) + "\n")


def jobs_of(cells: Sequence[Cell]) -> list[list[Cell]]:
    """Group cells into jobs, by their entries and tasks.

    Cells of an entry's home task, which are most, are divided into jobs of at most as many episodes as a batch has
    (`shares`). Those of any other task form one job, so that only one worker designs the policy for that task.
    """
    jobs: list[list[Cell]] = []
    for _, members in groupby(cells, lambda cell: cell.entry):
        for task, found in groupby(sorted(members, key=lambda cell: cell.point.task), lambda cell: cell.point.task):
            own = list(found)
            episodes = [len(cell.point.episodes) for cell in own]
            groups = shares(episodes) if task == own[0].entry.home else [range(len(own))]
            jobs += [[own[n] for n in some] for some in groups]
    return jobs


def compute(cells: Sequence[Cell]) -> list[dict[str, Any]]:
    """Compute cells of one entry together.

    Raises:
        ValueError: if this process has other code or another policy than the keys were made with.
    """
    entry = cells[0].entry
    if any(Cell.of(entry, cell.point).key != cell.key for cell in cells):
        raise ValueError(f"entry {entry.name}: this worker has other code or another policy than the sender of the job")
    return run_points(entry, [cell.point for cell in cells])
