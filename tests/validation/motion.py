"""Motions of programmes, and how far two are apart. Nothing here needs another engine.

A chain of N elements a link is of second order in 1 / N, so two chains of N / 2 and N give by Richardson's
extrapolation the reference for all models. A bent start is no transfer of shapes: it is each arm's own equilibrium
under the same force.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from flexarm_env import ArmParameters, FlexibleArm
from tests.validation.programmes import HELD, Model, Programme

Array = NDArray[np.float64]
MODEL_ANGLE = 0.5  # step times the fastest rate
LOW_PASS = 10.0  # [Hz]; of angles, forwards and backwards (no phase)


class Motion(NamedTuple):
    """A record of n instants, `HELD` apart."""

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


def rms(values: Array) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def low_passed(angles: Array) -> Array:
    """Return angles without what is faster than `LOW_PASS` (Butterworth, order 4, both ways). Shape (n, 2)."""
    return sosfiltfilt(butter(4, LOW_PASS, fs=1.0 / HELD, output="sos"), angles, axis=0)
