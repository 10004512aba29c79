"""What was recorded of an arm: arrays, files, and experiments in an environment."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.simulation.open_loop import LARGEST
from flexarm_env.validation import finite_array, number, real_array, shown

Array = NDArray[np.float64]
CHANNELS = {"joint": "rad", "deflection": "m", "tip": "m"}  # what is read, each of two numbers, with its unit
COLUMNS = ("time", *(f"{name}_{n}" for name in ("torque", *CHANNELS) for n in (1, 2)))  # of a file


def played_torques(torque: ArrayLike) -> Array:
    """Check torques held from each of two instants or more [N m]. Shape (n, 2)."""
    torques = finite_array("torque", torque, (None, 2), LARGEST)
    if len(torques) < 2:
        raise ValueError(f"torque: must have shape (n, 2), n at least 2, got {torques.shape}")
    return torques


@dataclass(frozen=True, eq=False)
class Recording:
    """What was recorded of an arm, at equal intervals. A missing reading is NaN; a channel without any is None.

    Attributes:
        period: between instants [s].
        torque: of shoulder and elbow, held from each instant to the next [N m]. Shape (n, 2).
        joint: encoders' theta1, theta2 [rad]. Shape (n, 2).
        deflection: of each link's tip off its root tangent, from strain gauges [m]. Shape (n, 2).
        tip: what the late sensor on link 2 read, x and y [m]. Shape (n, 2).
    """

    period: float
    torque: Array
    joint: Array | None = None
    deflection: Array | None = None
    tip: Array | None = None

    def __post_init__(self) -> None:
        number("period", self.period, "s", above=0.0)
        torques = played_torques(self.torque)
        object.__setattr__(self, "torque", torques)
        for name in CHANNELS:
            values = getattr(self, name)
            if values is None:
                continue
            array = real_array(name, values)
            if array.shape != torques.shape:
                raise ValueError(f"{name}: must have shape {torques.shape}, as the torque, got {array.shape}")
            if np.isinf(array).any() or np.isnan(array).all():
                raise ValueError(f"{name}: must be finite, or NaN where a reading is missing; without one leave it out")
            object.__setattr__(self, name, array)
        if not self.channels:
            raise ValueError(f"a recording without readings: one of {', '.join(CHANNELS)} is needed")

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels that it has."""
        return tuple(name for name in CHANNELS if getattr(self, name) is not None)

    def save(self, path: str | Path) -> None:
        """Write a CSV file of nine digits, with those of `COLUMNS` whose channels there are."""
        parts = {"torque": self.torque, **{name: getattr(self, name) for name in self.channels}}
        header = ["time", *(f"{name}_{n}" for name in parts for n in (1, 2))]
        rows = np.column_stack([self.period * np.arange(len(self.torque)), *parts.values()])
        np.savetxt(path, rows, "%.9g", delimiter=",", header=",".join(header), comments="")

    @classmethod
    def load(cls, path: str | Path) -> Recording:
        """Read a file as `save` writes it; an empty cell or "nan" is a missing reading.

        Raises:
            OSError: if the file cannot be read.
            ValueError: if it is not such a file, or its instants are not equally far apart.
        """
        try:
            with Path(path).open(newline="", encoding="utf-8-sig") as file:
                given, *rows = [[cell.strip("# ") for cell in row] for row in csv.reader(file) if row] or [[]]
        except (UnicodeDecodeError, csv.Error) as error:
            raise ValueError(f"{path}: not a CSV file ({error})") from None
        pairs = {name: (f"{name}_1", f"{name}_2") for name in ("torque", *CHANNELS)}
        there = [name for name, pair in pairs.items() if name == "torque" or not set(pair).isdisjoint(given)]
        missing = [one for one in ("time", *(one for name in there for one in pairs[name])) if one not in given]
        strange = [name for n, name in enumerate(given) if name not in COLUMNS or name in given[:n]]
        if missing or strange:
            raise ValueError(f"{path}: must be a table of {', '.join(COLUMNS)}; missing {missing}, unknown {strange}")
        if len(rows) < 2:
            raise ValueError(f"{path}: must have two rows of numbers at least, got {len(rows)}")
        numbers = []
        for n, row in enumerate(rows):
            try:
                if len(row) != len(given):
                    raise ValueError(f"must have {len(given)} cells, has {len(row)}")
                numbers.append([float(cell or "nan") for cell in row])
            except ValueError as error:
                raise ValueError(f"{path}: row {n + 1} below the header, {','.join(row)!r}: {error}") from None
        table: dict[str, Array] = dict(zip(given, np.transpose(numbers), strict=True))
        steps = np.diff(table["time"])
        if not np.all(np.abs(steps - steps.mean()) < 0.01 * steps.mean()):
            raise ValueError(
                f"{path}: time: instants must be equally far apart, got {steps.min():g} to {steps.max():g} s"
            )
        parts = {name: np.stack([table[one] for one in pairs[name]], axis=1) for name in there}
        try:
            return cls(float(steps.mean()), **parts)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from None


def record(env: gymnasium.Env[Any, Any], torque: Any, seed: int | None = None) -> Recording:
    """Play torques to an environment of `FlexArmEnv` from rest, and record what its sensors read, with delay and noise.

    Args:
        env: with ``action_mode="torque"``, ``scaled=False``, ``frame="world"``, and in its observation one or more of
            the blocks joint_angles, modal_coordinates and sensed_position. ``error_limit=None`` lets it leave its path.
        torque: [N m]. Shape (n, 2).
        seed: of the episode.

    Returns:
        The recording; it ends before an instant at which the episode ends.

    Raises:
        TypeError: for an environment of another class.
        ValueError: for other options, or torques beyond the limits.
    """
    inner = env.unwrapped
    if not isinstance(inner, FlexArmEnv):
        raise TypeError(f"env = {shown(env)}: must be a FlexArmEnv, wrapped or not")
    settings, torques = inner.settings, played_torques(torque)
    if (settings.action_mode, settings.scaled, settings.frame) != ("torque", False, "world"):
        raise ValueError('env: must have action_mode="torque", scaled=False, frame="world"')
    if settings.real_motors:
        raise ValueError("env: must have ideal motors; the torque of others is not the one that is played")
    if settings.payload_changes or settings.pulsed:
        raise ValueError("env: must have payload_changes = None and pulse_force = 0; a recording is of one free arm")
    if np.any(np.abs(torques) > settings.motor_limit):
        raise ValueError(f"torque: must be at most {settings.motor_limit} N m, got {np.abs(torques).max(axis=0)}")
    blocks, rows = inner.observation_blocks, []
    observation, _ = env.reset(seed=seed, options={"start": "corner"})
    for one in torques:
        rows.append(observation.astype(float))
        observation, _, terminated, truncated, _ = env.step((one / settings.motor_limit).astype(np.float32))
        if terminated or truncated:
            break
    if len(rows) < 2:
        raise ValueError(f"env: its episode ended after {settings.control_period:g} s; a recording has two instants")
    read = np.array(rows)
    parts = {"joint": "joint_angles", "deflection": "modal_coordinates", "tip": "sensed_position"}
    channels = {name: read[:, blocks[block]] for name, block in parts.items() if block in blocks}
    if "deflection" in channels:
        gauges = channels["deflection"]
        channels["deflection"] = inner.arm.tip_deflection(np.pad(gauges, ((0, 0), (2, 0))))
    return Recording(settings.control_period, torques[: len(rows)], **channels)
