"""Programmes of torque under which models of the arm and other engines are compared, and those models.

All start from rest in a bent pose (`release` from a bent shape too), and the torques are held for 1 ms in both engines,
so that no difference comes from how they are sampled. Amplitude 1 bends a link by about 4 % of its length.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters
from flexarm_env.parameters import MAX_MODES, Kinematics, ModeShapes

Array = NDArray[np.float64]
HELD = 1e-3  # torques are constant for [s]


@dataclass(frozen=True)
class Programme:
    """Something that is done to the arm."""

    name: str  # short
    title: str  # for pictures
    # torques of shoulder and elbow at amplitude 1 [N m] at the times of an array [s]; (n,) to (n, 2)
    shape: Callable[[Array], Array]
    duration: float = 2.0  # [s]
    amplitude: float = 1.0  # factor on torques and force
    elbow: float = 1.2  # theta2 at the start [rad]
    spin: float = 0.0  # rate of theta1 at the start, the arm unbent [rad/s]
    # at amplitude 1, pulls at the tip before the start, x and y [N]: the joints are held, the arm is at rest
    force: tuple[float, float] = (0.0, 0.0)
    arm: dict[str, Any] = field(default_factory=dict)  # fields of `ArmParameters` that differ from the undamped arm

    def torques(self) -> Array:
        """Held torques [N m]. Shape (steps, 2)."""
        time = HELD * np.arange(round(self.duration / HELD), dtype=float)
        return self.amplitude * self.shape(time)

    def parameters(self, **model: Any) -> ArmParameters:
        """Return the arm without damping, since the engines damp in different ways; `model`: further fields."""
        return ArmParameters.linear(**({"damping_ratio": 0.0} | self.arm | model))

    @property
    def joints(self) -> Array:
        """theta1, theta2 at the start [rad]."""
        return np.array([0.0, self.elbow])

    @property
    def pull(self) -> Array:
        """Force at the tip before the start [N]."""
        return self.amplitude * np.array(self.force)

    def times(self, amplitude: float) -> Programme:
        """Return the programme at another amplitude."""
        return replace(self, amplitude=amplitude)


def _pulse(time: Array, start: float, end: float) -> Array:
    return ((time >= start - 1e-9) & (time < end - 1e-9)).astype(float)


def doublet(time: Array) -> Array:
    """One way, then the other; the elbow against the shoulder, at a third."""
    push = _pulse(time, 0.0, 0.2) - _pulse(time, 0.2, 0.4)
    return np.column_stack([20.0 * push, -7.0 * push])


def bang_bang(time: Array) -> Array:
    """Return torques that change sign every 0.25 s at the shoulder, every 0.15 s at the elbow."""
    return np.column_stack([4.0 * (-1.0) ** np.floor(time / 0.25 + 1e-9), 1.2 * (-1.0) ** np.floor(time / 0.15 + 1e-9)])


def multi_sine(time: Array) -> Array:
    """Four sines up to 4.3 Hz, faded in over 0.5 s."""
    rise = np.sin(0.5 * np.pi * np.minimum(time / 0.5, 1.0)) ** 2
    turns = 2.0 * np.pi * time
    shoulder = sum(np.sin(f * turns + p) for f, p in ((0.7, 0.0), (1.3, 1.0), (2.9, 2.0), (4.3, 4.0)))
    elbow = sum(np.sin(f * turns + p) for f, p in ((0.9, 0.5), (1.7, 3.0), (3.1, 1.5), (4.1, 5.0)))
    return np.column_stack([8.0 * rise * shoulder, 2.5 * rise * elbow])


def spin_up(time: Array) -> Array:
    """Push the shoulder smoothly for 1.5 s; afterwards the arm is free."""
    push = np.sin(np.pi * np.minimum(time / 1.5, 1.0)) ** 2
    return np.column_stack([45.0 * push, 0.0 * push])


def nothing(time: Array) -> Array:
    """No torque."""
    return np.zeros((len(time), 2))


PROGRAMMES = (
    Programme("doublet", "doublet", doublet),
    Programme("bang_bang", "bang-bang", bang_bang),
    Programme("multi_sine", "multi-sine", multi_sine),
    Programme("spin_up", "spin-up", spin_up, duration=2.5),
    Programme("release", "release of a bent arm", nothing, force=(0.0, 7.0)),
    Programme("payload", "doublet with 0.5 kg at the tip", doublet, arm={"payload_mass": 0.5}),
)


class Model(NamedTuple):
    """Fields of `ArmParameters` that make a model."""

    kinematics: Kinematics
    modes_per_link: int
    mode_shapes: ModeShapes = "cantilever"

    @property
    def label(self) -> str:
        """Name it in tables and pictures."""
        shape = "mode" if self.mode_shapes == "cantilever" else "polynomial"
        return f"{self.kinematics}, {self.modes_per_link} {shape}{'s' if self.modes_per_link > 1 else ''}"


MODELS = tuple(
    Model(kinematics, modes, shapes)
    for kinematics in ("linear", "foreshortened")
    for shapes in ("cantilever", "polynomial")
    for modes in range(
        1 if shapes == "cantilever" else 3, MAX_MODES + 1
    )  # fewer polynomials are no use, see `test_arm`
)
DEFAULT = Model("foreshortened", 3, "polynomial")  # the default arm's
