"""The rigid arm's way along a reference: joint angles, rates and accelerations by inverse kinematics."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexarm_baselines.arrays import Floats, product
from flexarm_env.parameters import ArmParameters


class JointMotion(NamedTuple):
    """Motion of the joints; each of shape (..., 2).

    Attributes:
        angles: theta1, theta2 [rad].
        rates: [rad/s].
        accelerations: [rad/s^2].
    """

    angles: Floats
    rates: Floats
    accelerations: Floats


def joint_motion(
    arm: ArmParameters, position: Floats, velocity: Floats, acceleration: Floats, side: Floats
) -> JointMotion:
    """Return the motion of a rigid arm whose tip moves as given.

    Args:
        arm: link lengths.
        position: position of the tip [m]; beyond the reach, the arm points at it. Shape (..., 2).
        velocity: [m/s]. Shape (..., 2).
        acceleration: [m/s^2]. Shape (..., 2).
        side: side of the elbow, the sign of theta2. Shape (...).

    Returns:
        The motion. Angles of theta1 lie within half a turn of 0: see `nearest_turn`. At the straight arm the inverse
        of the Jacobian is damped (Nakamura and Hanafusa, J. Dyn. Sys. Meas. Control 108, 1986).
    """
    length_1, length_2 = arm.link_lengths
    squared = np.sum(position**2, axis=-1)
    cosine = np.clip((squared - length_1**2 - length_2**2) / (2.0 * length_1 * length_2), -1.0, 1.0)
    theta2 = side * np.arccos(cosine)
    lead = np.arctan2(length_2 * np.sin(theta2), length_1 + length_2 * np.cos(theta2))
    theta1 = np.arctan2(position[..., 1], position[..., 0]) - lead
    first, second = theta1, theta1 + theta2
    outer = length_2 * np.stack([np.cos(second), np.sin(second)], axis=-1)
    whole = length_1 * np.stack([np.cos(first), np.sin(first)], axis=-1) + outer
    jacobian = np.stack([_turned(whole), _turned(outer)], axis=-1)
    transposed = jacobian.swapaxes(-1, -2)
    damping = DAMPING**2 * length_1 * length_2 * np.eye(2)
    inverse = transposed @ np.linalg.inv(jacobian @ transposed + damping)
    rates = product(inverse, velocity)
    both = rates.sum(axis=-1, keepdims=True)
    centripetal = -(whole - outer) * rates[..., :1] ** 2 - outer * both**2
    accelerations = product(inverse, acceleration - centripetal)
    return JointMotion(np.stack([theta1, theta2], axis=-1), rates, accelerations)


DAMPING = 0.01  # of the inverse, as a share of the links' lengths


def nearest_turn(angle: Floats, other: Floats) -> Floats:
    """Return an angle, give or take whole turns, within half a turn of another [rad]."""
    return np.asarray(angle + 2.0 * np.pi * np.round((other - angle) / (2.0 * np.pi)))


def _turned(vectors: Floats) -> Floats:
    """Turn vectors by a right angle, counterclockwise."""
    return np.stack([-vectors[..., 1], vectors[..., 0]], axis=-1)
