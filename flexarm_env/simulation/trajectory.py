"""`Trajectory`: the one record of a run, open loop or under a policy; saves to and loads from npz."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.parameters import ArmParameters
from flexarm_env.simulation import archive
from flexarm_env.validation import instance, mapping, real_array, shown

Array = NDArray[np.float64]
_FORMAT = 1
_PAIRS = ("torque", "tip", "elbow", "rigid_tip", "tip_deflection")
_REQUIRED = ("time", "state", *_PAIRS, "kinetic_energy", "strain_energy")


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory:
    """A run sampled at n instants; m modes a link.

    Attributes:
        parameters: the arm.
        time: [s]. Shape (n,).
        state: theta1, theta2 [rad], modal coordinates of link 1 and of link 2, and the rates of all of these.
            Shape (n, 4 + 4 m).
        torque: of shoulder and elbow [N m]; at each instant the one that acts just after it (the last instant, after
            which nothing was computed, repeats the one before unless the torque is a function). Shape (n, 2).
        tip: true tip, with deflection [m]. Shape (n, 2).
        elbow: tip of link 1 [m]. Shape (n, 2).
        rigid_tip: tip by rigid kinematics of the joint angles (8), (9) [m]. Shape (n, 2).
        tip_deflection: deflection of each link's tip off its own root tangent [m]. Shape (n, 2).
        kinetic_energy: [J]. Shape (n,).
        strain_energy: [J]. Shape (n,).
        reference: where the tip should be [m]; policies only. Shape (n, 2).
        sensed: the sensor's late reading as a Cartesian position [m]; policies only. Shape (n, 2).
        gain: lambda held over the period that starts here; policies only. Shape (n,).
        reward: received for reaching this instant (0 at the first); policies only. Shape (n,).
        notes: anything plain (JSON) worth keeping with the run: case, policy, why it ended.
    """

    parameters: ArmParameters
    time: Array
    state: Array
    torque: Array
    tip: Array
    elbow: Array
    rigid_tip: Array
    tip_deflection: Array
    kinetic_energy: Array
    strain_energy: Array
    reference: Array | None = None
    sensed: Array | None = None
    gain: Array | None = None
    reward: Array | None = None
    notes: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check that all arrays cover the same instants, of this arm."""
        instance("parameters", self.parameters, ArmParameters)
        mapping("notes", self.notes)
        for name, array in self.arrays().items():
            if not (isinstance(array, np.ndarray) and array.dtype == np.float64):
                object.__setattr__(self, name, real_array(name, array))
        _check_shapes(self.parameters, {name: array.shape for name, array in self.arrays().items()})

    def __repr__(self) -> str:
        """Describe the run in a line."""
        span = f"{self.time[0]:g} to {self.time[-1]:g} s, " if len(self) else ""
        return f"{type(self).__name__}({span}{len(self)} instants, notes={shown(self.notes)})"

    def __len__(self) -> int:
        """Return the number of instants."""
        return len(self.time)

    def arrays(self) -> dict[str, Array]:
        """Return all arrays that the run has, by name."""
        values = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in ("parameters", "notes")}
        return {name: value for name, value in values.items() if value is not None}

    def save(self, path: str | Path) -> None:
        """Write an npz file: arrays, and the rest as JSON text (`archive`)."""
        archive.write(path, _FORMAT, {"parameters": asdict(self.parameters), "notes": self.notes}, self.arrays())

    @classmethod
    def load(cls, path: str | Path) -> Trajectory:
        """Read a file written by `save`.

        Raises:
            FileNotFoundError: if there is none.
            ValueError: if the file is not such a file, naming it and what is wrong.
        """
        return archive.read(path, _FORMAT, "Trajectory", cls._check_file, cls._from_file)

    @classmethod
    def _check_file(cls, head: dict[str, Any], entries: Mapping[str, archive.Entry]) -> None:
        for name, entry in entries.items():
            if entry.dtype != np.float64:
                raise ValueError(f"{name}: must hold float64, got {entry.dtype}")
        _check_shapes(_plain_parts(head)[0], {name: entry.shape for name, entry in entries.items()})

    @classmethod
    def _from_file(cls, head: dict[str, Any], arrays: dict[str, Array]) -> Trajectory:
        parameters, notes = _plain_parts(head)
        return cls(parameters=parameters, notes=notes, **arrays)


def _plain_parts(head: dict[str, Any]) -> tuple[ArmParameters, dict[str, Any]]:
    return ArmParameters(**mapping("parameters", head["parameters"])), mapping("notes", head["notes"])


def _check_shapes(parameters: ArmParameters, shapes: Mapping[str, tuple[int, ...]]) -> None:
    """Refuse arrays that are unknown, missing, or no run's of this arm."""
    for name in _REQUIRED:
        if name not in shapes:
            raise ValueError(f"{name}: must be an array, and is missing")
    instants = shapes["time"][:1]
    if not instants or instants == (0,):
        raise ValueError(f"time: must hold an instant at least, got shape {shapes['time']}")
    numbers = dict.fromkeys(("time", "kinetic_energy", "strain_energy", "gain", "reward"), ())
    pairs = dict.fromkeys((*_PAIRS, "reference", "sensed"), (2,))
    wanted: dict[str, tuple[int, ...]] = {**numbers, **pairs, "state": (4 + 4 * parameters.modes_per_link,)}
    for name, shape in shapes.items():
        if name not in wanted:
            raise ValueError(f"{shown(name)}: no such array; a Trajectory has {', '.join(wanted)}")
        if shape[:1] != instants:
            raise ValueError(f"{name}: has shape {shape}, time has {instants[0]} instants")
        if shape[1:] != wanted[name]:
            raise ValueError(f"{name}: must have shape {instants + wanted[name]}, got {shape}")


class DivergenceError(RuntimeError):
    """A simulation whose state stopped being finite.

    Attributes:
        time: time of the last finite state [s].
        trajectory: what was computed until then.
    """

    def __init__(self, time: float, trajectory: Trajectory) -> None:
        """Say when; keep what there is."""
        super().__init__(f"the state stopped being finite after t = {time:.6g} s; .trajectory holds the run until then")
        self.time = time
        self.trajectory = trajectory
