"""Programmes of torque under which arms are compared, their motions, and how far two are apart; without any engine.

All programmes start from rest in a bent pose (`release` from a bent shape too). In both engines the torques are held
for 1 ms, so that no difference comes from how they are sampled. Amplitude 1 bends a link by about 4 % of its length.

A chain of N elements a link is of second order in 1 / N, so two chains of N / 2 and N give by Richardson's
extrapolation the reference for all models. A bent start is no transfer of shapes: it is each arm's own equilibrium
under the same force.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.metrics.window import rms as rms
from flexarm_env.parameters import MAX_MODES, Kinematics, ModeShapes

Array = NDArray[np.float64]
HELD = 1e-3  # torques are constant for [s]
MODEL_ANGLE = 0.5  # step times the fastest rate
LOW_PASS = 10.0  # [Hz]; of angles, forwards and backwards (no phase)


@dataclass(frozen=True)
class Programme:
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
    kinematics: Kinematics
    modes_per_link: int
    mode_shapes: ModeShapes = "cantilever"

    @property
    def label(self) -> str:
        shape = "mode" if self.mode_shapes == "cantilever" else "polynomial"
        return f"{self.kinematics}, {self.modes_per_link} {shape}{'s' if self.modes_per_link > 1 else ''}"


MODELS = tuple(
    Model(kinematics, modes, shapes)
    for kinematics in ("linear", "foreshortened")
    for shapes in ("cantilever", "polynomial")
    for modes in range(1 if shapes == "cantilever" else 3, MAX_MODES + 1)  # fewer polynomials are no use: `test_arm`
)
DEFAULT = Model("foreshortened", 3, "polynomial")  # the default arm's


class Motion(NamedTuple):
    tip: Array  # x, y [m]. Shape (n, 2)
    joints: Array  # theta1, theta2 [rad]. Shape (n, 2)
    deflection: Array  # of each link's tip off its root tangent [m]. Shape (n, 2)

    @property
    def bend(self) -> float:
        """The largest deflection of a link's tip as a part of its length; the motion must be that of 4.5 m links."""
        return float((np.abs(self.deflection) / ArmParameters().link_lengths).max())


def extrapolated(coarse: Motion, fine: Motion) -> Motion:
    """Richardson's extrapolation from N / 2 and N elements, of second order."""
    return Motion(*(b + (b - a) / 3.0 for a, b in zip(coarse, fine, strict=True)))


def model_motion(programme: Programme, model: Model, angle: float = MODEL_ANGLE) -> Motion:
    """Run a programme on one of our models; angle: largest product of step and the model's fastest rate."""
    arm = FlexibleArm(programme.parameters(**model._asdict()))
    start = np.zeros(2 * arm.size)
    start[: arm.size] = bent_by(arm, programme.joints, programme.pull)
    start[arm.size] = programme.spin
    substeps = int(np.ceil(HELD * arm.fastest_rate() / angle))
    run = arm.simulate(start, programme.torques(), programme.duration, HELD, substeps)
    return Motion(run.tip, run.state[:, :2], run.tip_deflection)


def bent_state(arm: FlexibleArm, tips: tuple[float, float] = (0, 0), rates: tuple[float, float] = (0, 0)) -> Array:
    """Elbow at 1 rad, tips bent by so much in the first shape [m], joints turning [rad/s]. Shape (4 + 4 m,)."""
    m, n = arm.parameters.modes_per_link, arm.size
    state = np.zeros(2 * n)
    state[1], state[n : n + 2] = 1.0, rates
    state[[2, 2 + m]] = np.divide(tips, [link.tip_values[0] for link in arm.modes])
    return state


def bent_by(arm: FlexibleArm, joints: Array, force: Array) -> Array:
    """Return a model's coordinates bent by a force [N] at the tip, joints held: K q = J' F. Shape (2 + 2 m,)."""
    stiffness = np.concatenate([link.stiffness for link in arm.modes])

    def balanced(modal: Array) -> Array:
        jacobian = arm.point_jacobian(np.concatenate([joints, modal]), 2, arm.parameters.link_lengths[1])
        return (force @ jacobian)[2:] / stiffness

    return np.concatenate([joints, fixed_point(balanced, np.zeros(arm.size - 2))])


def fixed_point(function: Callable[[Array], Array], start: Array) -> Array:
    """Return x with function(x) = x, by damped repetition; a RuntimeError says that it does not settle."""
    x = start.copy()
    for _ in range(300):
        change = function(x) - x
        x += 0.5 * change
        if np.abs(change).max() < 1e-12:
            return x
    raise RuntimeError("the shape under this force was not found: it bends too far")


def apart(one: Array, other: Array) -> Array:
    """Return the distance between two tips [m], as long as both are recorded. Shape (n,)."""
    count = min(len(one), len(other))
    return np.linalg.norm(one[:count] - other[:count], axis=1)


def low_passed(angles: Array) -> Array:
    """Return angles without what is faster than `LOW_PASS` (Butterworth, order 4, both ways). Shape (n, 2)."""
    return sosfiltfilt(butter(4, LOW_PASS, fs=1.0 / HELD, output="sos"), angles, axis=0)
