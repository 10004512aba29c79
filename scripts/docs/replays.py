"""Write the laps that the site's replay viewer shows: docs/_static/replays/, a small file for each row and lap.

A file is JavaScript, so that a page opened from a disk may load it. It holds joint angles, modal coordinates, the late
reading and the torques of each control period, as whole numbers of a step. Differences of these, of the order that
takes the least room, are written with seven bits a byte, the lowest first and the sign in the lowest bit, as base64.
Where the tip is follows from the coordinates and from the links' shapes in `index.js`, here and in the viewer.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from flexarm_agents.board.entries import entries
from flexarm_agents.board.rows import Row
from flexarm_agents.evaluation.candidates import Candidate
from flexarm_agents.files import put
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
Whole = NDArray[np.int64]

FOLDER = DOCS / "_static" / "replays"
INDEX = "index.js"
ROWS = (
    *("ifdc", "flsac", "computed_torque", "shaped", "plan_lqr", "lqg", "lqg_adaptive", "nmpc"),
    *("agent square", "agent student", "agent student_unknown"),
)
AGENTS = {
    "agent square": "PPO: learned from the reward alone",
    "agent student": "a student of a privileged controller (DAgger), taught on this arm",
    "agent student_unknown": "a student of a privileged controller (DAgger), taught on arms that differ",
}
STEPS = {"joints": 2e-5, "modal": 5e-5, "sensed": 1e-3, "torque": 1e-2}  # [rad], [m], [m], [N m]
ORDERS = range(4)  # of differences
POINTS = 13  # of a drawn link


@dataclass
class Options:
    """Write the laps that the site's replay viewer shows."""

    output: Path = FOLDER
    """Folder for the files; it is made anew."""
    rows: tuple[str, ...] = ROWS
    """Names of the leaderboard's rows, in the viewer's order."""


# --- numbers as text -----------------------------------------------------------------------------------------------


def packed(values: Sequence[Whole]) -> tuple[str, list[int]]:
    """Write sequences of whole numbers as base64.

    Args:
        values: Shape (n,) each.

    Returns:
        The text, and the order of the differences of each sequence.
    """
    parts, orders = [], []
    for sequence in values:
        tried = [_bytes(np.diff(sequence, n=order, prepend=[0] * order)) for order in ORDERS]
        order = min(ORDERS, key=lambda one: len(tried[one]))
        parts.append(tried[order])
        orders.append(order)
    return base64.b64encode(b"".join(parts)).decode("ascii"), orders


def unpacked(text: str, orders: Sequence[int], instants: int) -> Whole:
    """Invert `packed`. Shape (len(orders), instants)."""
    numbers = _numbers(base64.b64decode(text, validate=True))
    differences = np.array([[next(numbers) for _ in range(instants)] for _ in orders], dtype=np.int64)
    if next(numbers, None) is not None:
        raise ValueError(f"data: has more than {len(orders)} sequences of {instants} numbers")
    for sequence, order in zip(differences, orders, strict=True):
        for _ in range(order):
            np.cumsum(sequence, out=sequence)
    return differences


def _bytes(values: Whole) -> bytes:
    """Write whole numbers with seven bits a byte; a byte's highest bit says that more follow."""
    found = bytearray()
    for value in np.where(values >= 0, 2 * values, -2 * values - 1).tolist():
        while value > 127:
            found.append(value & 127 | 128)
            value >>= 7
        found.append(value)
    return bytes(found)


def _numbers(data: bytes) -> Iterator[int]:
    """Read what `_bytes` wrote."""
    value = shift = 0
    for byte in data:
        value |= (byte & 127) << shift
        shift += 7
        if byte < 128:
            yield value >> 1 if value % 2 == 0 else -(value + 1) // 2
            value = shift = 0


# --- a lap ---------------------------------------------------------------------------------------------------------


def replay(lap: Trajectory) -> dict[str, Any]:
    """Return a lap as plain values: numbers of a step for each channel, and why it ended.

    Args:
        lap: record of `run_policy`.

    Raises:
        ValueError: for a record without a sensor's reading.
    """
    if lap.sensed is None:
        raise ValueError("lap: has no reading of a sensor; must be a record of run_policy")
    size = lap.state.shape[1] // 2
    found = {"joints": lap.state[:, :2], "modal": lap.state[:, 2:size], "sensed": lap.sensed, "torque": lap.torque}
    whole = {name: np.rint(values / STEPS[name]).astype(np.int64) for name, values in found.items()}
    data, orders = packed([sequence for values in whole.values() for sequence in values.T])
    return {
        "interval": round(float(lap.time[1] - lap.time[0]), 9),
        "instants": len(lap),
        "ended": lap.notes["ended"],
        "channels": [[name, values.shape[1], STEPS[name]] for name, values in whole.items()],
        "orders": orders,
        "data": data,
    }


def channels(one: Mapping[str, Any]) -> dict[str, Array]:
    """Return the numbers of a replay: joints, modal, sensed, torque. Shape (n, ...) each."""
    whole = unpacked(one["data"], one["orders"], one["instants"])
    ends = np.cumsum([count for _, count, _ in one["channels"]])[:-1]
    parts = np.split(whole, ends)
    return {name: step * part.T for (name, _, step), part in zip(one["channels"], parts, strict=True)}


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
    """Name the file of a row's lap."""
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
        data, orders = packed(list(np.rint(record.reference / STEPS["joints"]).astype(np.int64).T))
        found[lap] = {"data": data, "orders": orders, "step": STEPS["joints"], "instants": len(record)}
    return found


def _script(call: str, *values: Any) -> str:
    arguments = ", ".join(json.dumps(value, allow_nan=False, separators=(",", ":")) for value in values)
    return f"flexarm.{call}({arguments});\n"


def text_of(row: str) -> str:
    """Return what a row is, in a line."""
    return CONTROLLERS[row].text.replace("`", "") if row in CONTROLLERS else AGENTS[row]


def record(row: Row) -> tuple[Candidate, dict[str, Trajectory]]:
    """Run both nominal laps of a row."""
    candidate = row.candidate(fresh=True)
    laps = {lap: run_policy(candidate.env, candidate.policy, seed=0, lap=lap) for lap in LAPS}
    candidate.env.close()
    return candidate, laps


def write(names: Sequence[str], folder: Path) -> None:
    """Run the rows, and write their files and the index.

    Args:
        names: of the rows.
        folder: an existing one.
    """
    known = {row.name: row for row in entries(())}
    index: dict[str, Any] = {"laps": {name: lap.text for name, lap in LAPS.items()}, "rows": []}
    for name in tqdm(names, unit="row"):
        candidate, laps = record(known[choice("rows", name, tuple(known))])
        for lap, one in laps.items():
            text = _script("replay", name, lap, replay(one))
            put(folder / file_name(name, lap), lambda aside, text=text: aside.write_text(text))  # type: ignore[misc]
        files = {lap: file_name(name, lap) for lap in laps}
        reads, privileged = list(candidate.reads), candidate.privileged
        index["rows"].append(
            {"name": name, "text": text_of(name), "reads": reads, "privileged": privileged, "files": files}
        )
        index.setdefault("links", shapes(FlexibleArm(next(iter(laps.values())).parameters)))
        index.setdefault("references", _references(laps))
    put(folder / INDEX, lambda aside: aside.write_text(_script("replays", index)))


def main() -> None:
    """Command line."""
    options = read_options("python -m scripts.docs.replays", Options())
    with replacing(options.output, INDEX) as folder:
        write(options.rows, folder)
    size = sum(path.stat().st_size for path in options.output.iterdir())
    print(f"{options.output}: {len(options.rows)} rows, {size / 1000:.0f} kB")


if __name__ == "__main__":
    run(main)
