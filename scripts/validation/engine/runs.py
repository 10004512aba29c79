"""One programme on the chain and on our models: records of the same kind, and how far they are apart.

A chain of N elements a link is of second order in 1 / N, so two chains of N / 2 and N give by Richardson's
extrapolation the reference for all models.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from flexarm_env import ArmParameters, FlexibleArm
from scripts.validation.engine.chain import CHAIN_ANGLE, HELD, MODEL_ANGLE, EngineChain, bent_by
from scripts.validation.engine.programmes import Programme

Array = NDArray[np.float64]
LOW_PASS = 10.0  # [Hz]; of angles, forwards and backwards (no phase)


class Motion(NamedTuple):
    """A record of n instants, `HELD` apart.

    Attributes:
        tip: x, y [m]. Shape (n, 2).
        joints: theta1, theta2 [rad]. Shape (n, 2).
        deflection: of each link's tip off its root tangent [m]. Shape (n, 2).
    """

    tip: Array
    joints: Array
    deflection: Array


def chain_motion(programme: Programme, elements: int, angle: float = CHAIN_ANGLE) -> Motion:
    """Run a programme on a chain.

    Args:
        programme: the programme.
        elements: bending elements a link.
        angle: see `EngineChain`.
    """
    arm = EngineChain(elements, programme.parameters(), angle)
    arm.place(programme.joints, programme.pull)
    arm.data.qvel[0] = programme.spin
    sights = [arm.look()]
    for torque in programme.torques():
        arm.advance(torque)
        sights.append(arm.look())
    return Motion(*(np.array([getattr(sight, name) for sight in sights]) for name in Motion._fields))


def extrapolated(coarse: Motion, fine: Motion) -> Motion:
    """Richardson's extrapolation from N / 2 and N elements, of second order."""
    return Motion(*(b + (b - a) / 3.0 for a, b in zip(coarse, fine, strict=True)))


def model_motion(programme: Programme, angle: float = MODEL_ANGLE, **model: Any) -> Motion:
    """Run a programme on one of our models.

    Args:
        programme: the programme.
        angle: largest product of step and the model's fastest rate.
        **model: fields of `ArmParameters`.
    """
    arm = FlexibleArm(programme.parameters(**model))
    start = np.zeros(2 * arm.size)
    start[: arm.size] = bent_by(arm, programme.joints, programme.pull)
    start[arm.size] = programme.spin
    substeps = int(np.ceil(HELD * arm.fastest_rate() / angle))
    run = arm.simulate(start, programme.torques(), programme.duration, HELD, substeps)
    return Motion(run.tip, run.state[:, :2], run.tip_deflection)


def apart(one: Motion, other: Motion) -> Array:
    """Distance between the tips [m]. Shape (n,)."""
    return np.linalg.norm(one.tip - other.tip, axis=1)


def rms(values: Array) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def low_passed(angles: Array) -> Array:
    """Angles without what is faster than `LOW_PASS` (Butterworth, order 4, forwards and backwards). Shape (n, 2)."""
    return sosfiltfilt(butter(4, LOW_PASS, fs=1.0 / HELD, output="sos"), angles, axis=0)


def peak_bend(deflection: Array) -> float:
    """Largest deflection of a link's tip as a part of its length.

    Args:
        deflection: of the default arm's links [m]. Shape (n, 2).
    """
    return float((np.abs(deflection) / ArmParameters().link_lengths).max())
