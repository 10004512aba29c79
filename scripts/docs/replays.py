"""Write the laps that the site's replay viewer shows: docs/_static/replays/, a small file for each entry and lap.

A file is JavaScript, so that a page opened from a disk may load it. It holds joint angles, modal coordinates, the late
reading and the torques of each control period, as second differences of whole numbers of a step. Where the tip is
follows from the coordinates and from the links' shapes in `index.js`, here and in the viewer.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from flexarm_agents.board.entries import Entry, all_entries
from flexarm_agents.evaluation.candidates import Candidate
from flexarm_agents.files import write_text
from flexarm_baselines.registry import CONTROLLERS
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.trajectory import Trajectory
from flexarm_env.validation import choice
from scripts.common.command_line import read_options, run
from scripts.common.markdown import DOCS
from scripts.common.result_files import replacing

Array = NDArray[np.float64]

FOLDER = DOCS / "_static" / "replays"
INDEX = "index.js"
ENTRIES = (
    *("ifdc", "flsac", "computed_torque", "shaped", "plan_lqr", "lqg", "lqg_adaptive", "nmpc"),
    *("agent square", "agent student", "agent student_unknown"),
)
AGENTS = {
    "agent square": "PPO: learned from the reward alone",
    "agent student": "a student of a privileged controller (DAgger), taught on this arm",
    "agent student_unknown": "a student of a privileged controller (DAgger), taught on arms that differ",
}
STEPS = {"joints": 2e-5, "modal": 5e-5, "sensed": 1e-3, "torque": 1e-2}  # [rad], [m], [m], [N m]
POINTS = 13  # of a drawn link


@dataclass
class Options:
    """Write the laps that the site's replay viewer shows."""

    output: Path = FOLDER
    """Folder for the files; it is made anew."""
    entries: tuple[str, ...] = ENTRIES
    """Names of entries of the leaderboard, in the viewer's order."""


def packed(values: Array, step: float) -> list[list[int]]:
    """Return sequences (n, k) as whole numbers of a step, by their second differences, which have few digits."""
    whole = np.rint(values / step).astype(np.int64).T
    found: list[list[int]] = np.diff(whole, n=2, prepend=np.zeros((len(whole), 2), np.int64)).tolist()
    return found


def unpacked(data: Sequence[Sequence[int]], step: float) -> Array:
    """Invert `packed`, but for rounding. Shape (n, k)."""
    return np.array(data, dtype=np.int64).cumsum(axis=1).cumsum(axis=1).T.astype(np.float64) * step


# --- a lap ---------------------------------------------------------------------------------------------------------


def replay(lap: Trajectory) -> dict[str, Any]:
    """Return a lap as plain values: numbers of a step for each channel, and why it ended."""
    if lap.sensed is None:
        raise ValueError("lap: has no reading of a sensor; must be a record of run_policy")
    size = lap.state.shape[1] // 2
    found = {"joints": lap.state[:, :2], "modal": lap.state[:, 2:size], "sensed": lap.sensed, "torque": lap.torque}
    return {
        "interval": round(float(lap.time[1] - lap.time[0]), 9),
        "instants": len(lap),
        "ended": lap.notes["ended"],
        "channels": [[name, values.shape[1], STEPS[name]] for name, values in found.items()],
        "data": [sequence for name, values in found.items() for sequence in packed(values, STEPS[name])],
    }


def channels(one: Mapping[str, Any]) -> dict[str, Array]:
    """Return the numbers of a replay: joints, modal, sensed, torque. Shape (n, ...) each."""
    found, first = {}, 0
    for name, count, step in one["channels"]:
        found[name] = unpacked(one["data"][first : first + count], step)
        first += count
    return found


def read(path: Path) -> list[Any]:
    """Return the arguments of the call that a data file is."""
    text = path.read_text(encoding="utf-8")
    found: list[Any] = json.loads(f"[{text[text.index('(') + 1 : text.rindex(')')]}]")
    return found


def tips(arm: FlexibleArm, one: Mapping[str, Any]) -> Array:
    """Return where the tip of a replay is [m]. Shape (n, 2)."""
    found = channels(one)
    return arm.tip(np.concatenate([found["joints"], found["modal"]], axis=1))


# --- files ---------------------------------------------------------------------------------------------------------


def file_name(row: str, lap: str) -> str:
    """Name the file of an entry's lap."""
    return f"{row.replace(' ', '_')}_{lap}.js"


def shapes(arm: FlexibleArm) -> list[dict[str, Any]]:
    """Return what places a link's points: for each, x, phi and the lower triangle of S (`physics.bent_link`)."""
    links = []
    for link, length in enumerate(arm.parameters.link_lengths, 1):
        points = [arm.place(link, float(x)) for x in np.linspace(0.0, length, POINTS)]
        slopes = arm.constants.elbow_slopes if link == 1 else ()
        places = [_short((point.distance, *point.values, *point.foreshortening)) for point in points]
        links.append({"slopes": _short(slopes), "points": places})
    return links


def _short(values: Sequence[float]) -> list[float]:
    return [float(f"{value:.9g}") for value in values]


def _references(laps: Mapping[str, Trajectory]) -> dict[str, Any]:
    """Return where the tip should be on each lap, as `replay` writes it [m]."""
    found = {}
    for lap, record in laps.items():
        assert record.reference is not None
        step = STEPS["joints"]
        found[lap] = {"step": step, "instants": len(record), "data": packed(record.reference, step)}
    return found


def _script(call: str, *values: Any) -> str:
    arguments = ", ".join(json.dumps(value, allow_nan=False, separators=(",", ":")) for value in values)
    return f"flexarm.{call}({arguments});\n"


def text_of(row: str) -> str:
    """Return what an entry is, in a line."""
    return CONTROLLERS[row].text.replace("`", "") if row in CONTROLLERS else AGENTS[row]


def record(row: Entry) -> tuple[Candidate, dict[str, Trajectory]]:
    """Run both nominal laps of an entry."""
    candidate = row.candidate(fresh=True)
    laps = {lap: run_policy(candidate.env, candidate.policy, seed=0, lap=lap) for lap in LAPS}
    candidate.env.close()
    return candidate, laps


def write(names: Sequence[str], folder: Path) -> None:
    """Run the entries, and write their files and the index."""
    known = {row.name: row for row in all_entries(())}
    index: dict[str, Any] = {"laps": {name: lap.text for name, lap in LAPS.items()}, "rows": []}
    for name in tqdm(names, unit="entry"):
        candidate, laps = record(known[choice("entries", name, tuple(known))])
        for lap, one in laps.items():
            write_text(folder / file_name(name, lap), _script("replay", name, lap, replay(one)))
        files = {lap: file_name(name, lap) for lap in laps}
        reads, privileged = list(candidate.reads), candidate.privileged
        index["rows"].append(
            {"name": name, "text": text_of(name), "reads": reads, "privileged": privileged, "files": files}
        )
        index.setdefault("links", shapes(FlexibleArm(next(iter(laps.values())).parameters)))
        index.setdefault("references", _references(laps))
    write_text(folder / INDEX, _script("replays", index))


def main() -> None:
    """Command line."""
    options = read_options("python -m scripts.docs.replays", Options())
    with replacing(options.output, INDEX) as folder:
        write(options.entries, folder)
    size = sum(path.stat().st_size for path in options.output.iterdir())
    print(f"{options.output}: {len(options.entries)} entries, {size / 1000:.0f} kB")


if __name__ == "__main__":
    run(main)
