"""Write the laps that the site's replay viewer shows: docs/_static/replays/, a small file for each entry and lap.

A file is JavaScript, so that a page opened from a disk may load it. It holds the reference, joint angles, modal
coordinates, the late reading and the torques of each control period, as second differences of whole numbers of a step,
which are written in the digits of source maps (base64 VLQ). Where the tip is follows from the coordinates and from the
links' shapes in `index.js`, here and in the viewer.
"""

import json
import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from flexarm_agents.board.entries import Entry, all_entries
from flexarm_agents.board.terms import TASKS
from flexarm_agents.environments import settings_of
from flexarm_agents.evaluation.candidates import Candidate
from flexarm_agents.files import write_text
from flexarm_baselines.registry import CONTROLLERS
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_policy
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.trajectory import Trajectory
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
    "agent carry": "a student of a privileged controller (DAgger), taught with payloads that differ",
    "agent race": "PPO: learned from the reward alone",
}
PAYLOAD = 1.2  # that is carried [kg]


class Kind(NamedTuple):
    """A kind of lap that the viewer offers."""

    entries: tuple[str, ...]  # names of entries of the leaderboard that run it, in the viewer's order
    task: str  # of the board (`terms.TASKS`)
    start: Mapping[str, Any]  # options of the reset
    text: str


KINDS = {
    **{name: Kind(ENTRIES, "square", lap.reset_options(), lap.text) for name, lap in LAPS.items()},
    "race": Kind(
        ("race_lqg", "agent race", "race_mpcc", "race_lqg_adaptive"),
        "race",
        {"start": "corner"},
        "three laps from rest, as fast as possible; each controller moves its own target, within 25 cm of the tip",
    ),
    "carry": Kind(
        ("lqg_adaptive", "lqg", "agent carry"),
        "carry",
        LAPS["plain"].reset_options() | {"parameters": {"payload_mass": PAYLOAD}},
        f"rests of 2 s at the corners; the tip takes up {PAYLOAD:g} kg in the first and puts them down in the third",
    ),
}
# [m], [rad], [m], [m], [N m]
STEPS = {"reference": 2e-5, "joints": 2e-5, "modal": 5e-5, "sensed": 1e-3, "torque": 1e-2}
POINTS = 13  # of a drawn link
DIGITS = string.ascii_uppercase + string.ascii_lowercase + string.digits + "+/"


@dataclass
class Options:
    """Write the laps that the site's replay viewer shows."""

    output: Path = FOLDER
    """Folder for the files; it is made anew."""


def packed(values: Array, step: float) -> list[str]:
    """Return sequences (n, k) as whole numbers of a step, by their second differences, which have few digits."""
    whole = np.rint(values / step).astype(np.int64).T
    differences = np.diff(whole, n=2, prepend=np.zeros((len(whole), 2), np.int64))
    return ["".join(map(_written, sequence)) for sequence in differences.tolist()]


def _written(value: int) -> str:
    """Write a whole number by 5 bits a digit, the lowest first, of which the lowest is the sign; 32: more follow."""
    rest, found = 2 * abs(value) + (value < 0), ""
    while rest > 31:
        found += DIGITS[32 + rest % 32]
        rest //= 32
    return found + DIGITS[rest]


def unpacked(data: Sequence[str], step: float) -> Array:
    """Invert `packed`, but for rounding. Shape (n, k)."""
    return np.array([_numbers(text) for text in data]).cumsum(axis=1).cumsum(axis=1).T.astype(np.float64) * step


def _numbers(text: str) -> list[int]:
    found, value, place = [], 0, 1
    for digit in map(DIGITS.index, text):
        value += digit % 32 * place
        place *= 32
        if digit < 32:
            found.append(-(value // 2) if value % 2 else value // 2)
            value, place = 0, 1
    return found


# --- a lap ---------------------------------------------------------------------------------------------------------


def replay(lap: Trajectory) -> dict[str, Any]:
    """Return a lap as plain values: numbers of a step for each channel, and why it ended."""
    if lap.sensed is None or lap.reference is None:
        raise ValueError("lap: has no reading of a sensor; must be a record of run_policy")
    size = lap.state.shape[1] // 2
    found = {"reference": lap.reference, "joints": lap.state[:, :2], "modal": lap.state[:, 2:size]}
    found |= {"sensed": lap.sensed, "torque": lap.torque}
    return {
        "interval": round(float(lap.time[1] - lap.time[0]), 9),
        "instants": len(lap),
        "ended": lap.notes["ended"],
        "channels": [[name, values.shape[1], STEPS[name]] for name, values in found.items()],
        "data": [sequence for name, values in found.items() for sequence in packed(values, STEPS[name])],
    }


def channels(one: Mapping[str, Any]) -> dict[str, Array]:
    """Return the numbers of a replay: reference, joints, modal, sensed, torque. Shape (n, ...) each."""
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


def _script(call: str, *values: Any) -> str:
    arguments = ", ".join(json.dumps(value, allow_nan=False, separators=(",", ":")) for value in values)
    return f"flexarm.{call}({arguments});\n"


def text_of(row: str) -> str:
    """Return what an entry is, in a line."""
    return CONTROLLERS[row].text.replace("`", "") if row in CONTROLLERS else AGENTS[row]


def record(row: Entry, kind: Kind) -> tuple[Candidate, Trajectory]:
    """Run a lap of an entry on the nominal arm."""
    candidate = row.candidate(kind.task, fresh=True)
    with candidate.env as env:
        lap = run_policy(env, candidate.policy, seed=0, options=dict(kind.start))
    return candidate, lap


def write(folder: Path) -> None:
    """Run the entries, and write their files and the index."""
    known = {row.name: row for row in all_entries(())}
    names = dict.fromkeys(name for kind in KINDS.values() for name in kind.entries)
    index: dict[str, Any] = {"laps": {name: _told(kind) for name, kind in KINDS.items()}, "rows": []}
    for name in tqdm(names, unit="entry"):
        files = {}
        for which, kind in KINDS.items():
            if name in kind.entries:
                candidate, lap = record(known[name], kind)
                files[which] = file_name(name, which)
                write_text(folder / files[which], _script("replay", name, which, replay(lap)))
        reads, privileged = list(candidate.reads), candidate.privileged
        index["rows"].append(
            {"name": name, "text": text_of(name), "reads": reads, "privileged": privileged, "files": files}
        )
    index["links"] = shapes(FlexibleArm())
    write_text(folder / INDEX, _script("replays", index))


def _told(kind: Kind) -> dict[str, Any]:
    """Return what the viewer says of a kind of lap, and when the tip carries a payload [s]."""
    settings = settings_of(TASKS[kind.task].environment, TASKS[kind.task].options)
    changes = [round(settings.lap_time * share, 3) for share, _ in settings.payload_changes or ()]
    return {"text": kind.text, "carried": changes}


def main() -> None:
    """Command line."""
    options = read_options("python -m scripts.docs.replays", Options())
    with replacing(options.output, INDEX) as folder:
        write(folder)
    sizes = [path.stat().st_size for path in options.output.iterdir()]
    print(f"{options.output}: {len(sizes)} files, {sum(sizes) / 1000:.0f} kB")


if __name__ == "__main__":
    run(main)
