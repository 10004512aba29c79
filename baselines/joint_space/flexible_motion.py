"""Feed-forward for bending links: the motion and the torques with which the flexible arm's tip goes where it should.

The torques that move the tip along a path cannot be computed forward in time: between joint torques and tip the arm is
of nonminimum phase. For a path that is known beforehand there is a bounded solution, and for one that is slow beside
the arm's free vibrations a fixed-point iteration finds it: bend the links by the inertial forces of the motion so far
(quasi-static in the first step), turn the joints so that the bent arm's tip is on the path, and repeat with the bent
motion's accelerations. A low-pass filter without phase keeps out what is quicker than the iteration can follow.

Sources: Bayo, *A finite-element approach to control the end-point motion of a single-link flexible robot*, J. Robotic
Systems 4, 1987; Devasia, Chen & Paden, *Nonlinear inversion-based output tracking*, IEEE Trans. Automatic Control 41,
1996 (the bounded solution by iteration).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import butter, sosfiltfilt

from flexarm_baselines.arrays import Floats
from flexarm_env.analysis.natural import natural_modes
from flexarm_env.analysis.operating_point import OperatingPoint
from flexarm_env.simulation.arm import FlexibleArm

ITERATIONS = 5
CUTOFF = 0.65  # of the filter, as a share of the first free vibration's frequency
ORDER = 4  # of the Butterworth filter, which runs forward and backward
NEWTON_STEPS = 3  # of the joints in each iteration
DAMPING = 0.3  # [m/rad]; of the joints' correction, so that the straight arm has one too


class FlexibleMotion(NamedTuple):
    """A motion of the arm at n instants, and the torques that it takes.

    Attributes:
        states: Shape (n, 4 + 4 m).
        torques: of shoulder and elbow at each instant [N m]. Shape (n, 2).
        residual: largest force on a mode that the motion needs and no motor exerts, as a torque about the link's root
            [N m]: the part that was too quick for the filter.
    """

    states: Floats
    torques: Floats
    residual: float


def rigid_motion(arm: FlexibleArm, joints: Floats, step: float) -> FlexibleMotion:
    """Return the motion of the arm with links that do not bend.

    Args:
        arm: the arm.
        joints: joint angles at instants `step` apart [rad]. Shape (n, 2).
        step: [s].
    """
    q = np.zeros((len(joints), arm.size))
    q[:, :2] = joints
    rates, forces = _forces(arm, q, step)
    return FlexibleMotion(np.concatenate([q, rates], axis=1), forces[:, :2], 0.0)


def flexible_motion(arm: FlexibleArm, joints: Floats, step: float) -> FlexibleMotion:
    """Return the motion with which the bent arm's tip is where the straight-linked arm's would be.

    Args:
        arm: the arm.
        joints: joint angles of the arm with straight links at instants `step` apart [rad]; they should begin and end in
            motions that have lasted for half a second. Shape (n, 2).
        step: [s].
    """
    q = np.zeros((len(joints), arm.size))
    q[:, :2] = joints
    target = arm.tip(q)
    stiffness = _modal_stiffness(arm)
    sections = butter(ORDER, CUTOFF * first_free_vibration(arm), fs=2.0 * np.pi / step, output="sos")
    for _ in range(ITERATIONS):
        _, forces = _forces(arm, q, step)
        bent = q[:, 2:] - np.linalg.solve(stiffness, forces[:, 2:].T).T
        q[:, 2:] = sosfiltfilt(sections, bent, axis=0)
        _turn_joints(arm, q, target)
    rates, forces = _forces(arm, q, step)
    length = max(arm.parameters.link_lengths)
    tips = np.concatenate([np.abs(link.tip_values) for link in arm.modes])
    residual = float(np.max(np.abs(forces[:, 2:]) / tips) * length)
    return FlexibleMotion(np.concatenate([q, rates], axis=1), forces[:, :2], residual)


def first_free_vibration(arm: FlexibleArm) -> float:
    """Return the frequency of an arm's first vibration with free joints and a right angle at the elbow [rad/s]."""
    bent = OperatingPoint.at_angles(arm, (0.0, 0.5 * np.pi))
    return float(natural_modes(bent, "free").frequencies[2])  # after the two rigid motions


def _forces(arm: FlexibleArm, q: Floats, step: float) -> tuple[Floats, Floats]:
    """Return rates, and the generalised forces that a motion needs beside the links' own. Shape (n, 2 + 2 m) each.

    The forces on the joints are the motors' torques [N m].
    """
    rates = np.gradient(q, step, axis=0)
    accelerations = np.gradient(rates, step, axis=0)
    free = arm.acceleration(np.concatenate([q, rates], axis=1))
    return rates, np.einsum("nij,nj->ni", arm.mass_matrix(q), accelerations - free)


def _turn_joints(arm: FlexibleArm, q: Floats, target: Floats) -> None:
    """Turn the joints in place so that the bent arm's tip is at the target, by damped least squares."""
    length = arm.parameters.link_lengths[1]
    for _ in range(NEWTON_STEPS):
        jacobian = arm.point_jacobian(q, 2, length)[..., :2]
        transposed = jacobian.swapaxes(-1, -2)
        damped = jacobian @ transposed + DAMPING**2 * np.eye(2)
        q[:, :2] += (transposed @ np.linalg.solve(damped, (target - arm.tip(q))[..., None]))[..., 0]


def _modal_stiffness(arm: FlexibleArm) -> Floats:
    """Return the stiffness of the modal coordinates. Shape (2 m, 2 m)."""
    rest = np.zeros(2 * arm.size)
    slopes = arm.linearise(rest).A[arm.size :, : arm.size]
    return -(arm.mass_matrix(rest[: arm.size]) @ slopes)[2:, 2:]
