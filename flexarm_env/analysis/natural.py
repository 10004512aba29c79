"""Natural modes of the resting arm, joints free or locked.

Source: Meirovitch, *Fundamentals of vibrations* (2001), ch. 7 (eigenvalue problem of M and K, modal damping).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from flexarm_env.analysis.operating_point import OperatingPoint
from flexarm_env.validation import choice, instance

Array = NDArray[np.float64]
Joints = Literal["free", "locked"]


@dataclass(frozen=True, eq=False)
class NaturalModes:
    """Modes of small vibrations, slowest first.

    Attributes:
        frequencies: without damping [rad/s]; two (free joints) or none (locked) are 0. Shape (k,).
        damping_ratios: ``phi^T D phi / (2 omega)``, which is the ratio of the pole to first order in the damping; 0
            for a rigid-body mode. Shape (k,).
        shapes: one in each row, coordinates as in `flexarm_env.simulation.arm`, scaled to ``phi^T M phi = 1``; the
            sign makes the largest entry positive. Shape (k, 2 + 2 m).
    """

    frequencies: Array
    damping_ratios: Array
    shapes: Array


def natural_modes(point: OperatingPoint, joints: Joints = "free") -> NaturalModes:
    """Return the natural frequencies, damping ratios and shapes about an equilibrium.

    The frequencies with locked joints are the magnitudes of the joint angles' zeros, those of the undamped arm.

    Args:
        point: an equilibrium: at rest, straight links, no torque.
        joints: "free" or "locked".

    Raises:
        ValueError: for another choice, or a point that is no equilibrium, with the configuration.
    """
    instance("point", point, OperatingPoint)
    choice("joints", joints, ("free", "locked"))
    if not point.is_equilibrium():
        raise ValueError(f"{point}: no equilibrium, so the arm does not vibrate about it")
    size = point.arm.size
    kept = slice(0 if joints == "free" else 2, None)
    matrix = point.linearisation.A
    mass = point.arm.mass_matrix(point.q)
    stiffness, damping = (-mass @ matrix[size:, part] for part in (slice(0, size), slice(size, None)))
    mass, stiffness, damping = mass[kept, kept], stiffness[kept, kept], damping[kept, kept]
    squares, shapes = scipy.linalg.eigh(0.5 * (stiffness + stiffness.T), mass)
    squares = np.where(squares > 1e-12 * squares[-1], squares, 0.0)
    frequencies = np.sqrt(squares)
    shapes = shapes.T * np.sign(shapes.T[np.arange(len(squares)), np.abs(shapes).argmax(axis=0)])[:, None]
    resistance = np.einsum("ij,jk,ik->i", shapes, damping, shapes)
    ratios = np.divide(resistance, 2.0 * frequencies, out=np.zeros_like(squares), where=frequencies > 0.0)
    full = np.zeros((len(squares), size))
    full[:, kept] = shapes
    return NaturalModes(frequencies, ratios, full)
