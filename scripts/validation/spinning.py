"""At which spin the straight arm of linear theory turns unstable, in finite elements, without the package's equations.

With angular momentum kept, the arm that spins at Omega has the potential U - Omega^2 I / 2 to second order, where I is
its moment of inertia about the shoulder: at the spin where this ceases to be positive, straight spin is stable no more.
Nothing couples by Coriolis forces, since to first order every point moves across. Linear theory knows no
foreshortening, so that deflections raise I and soften the arm; at a turned elbow, which is no deflection, I falls.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from flexarm_env import ArmParameters
from scripts.validation.reference_models.finite_elements import ACROSS, BENDING

Array = NDArray[np.float64]


def critical_spin(parameters: ArmParameters, elements: int = 20) -> float:
    """Spin at which the bare straight arm with free joints turns unstable in linear theory [rad/s].

    Args:
        parameters: the arm; lumped masses are not counted.
        elements: cubic, of each link.
    """
    length_1, length_2 = parameters.link_lengths
    mass_1, stiffness_1 = _beam(length_1, elements, parameters.masses_per_length[0], parameters.flexural_rigidities[0])
    mass_2, stiffness_2 = _beam(length_2, elements, parameters.masses_per_length[1], parameters.flexural_rigidities[1])
    n = 2 * elements  # of deflection and slope at all nodes but the clamped one
    x = np.linspace(0.0, length_2, elements + 1)
    still, ones = np.zeros_like(x), np.ones_like(x)
    moved, turned = (np.column_stack(pair).ravel() for pair in ((ones, still), (x, ones)))
    # what moves link 2 across: link 1's tip, the absolute turn alpha of its root, its own deflection
    across = np.zeros((n + 2, 2 * n + 1))
    across[:, n - 2], across[:, n] = moved, turned
    across[2:, n + 1 :] = np.eye(n)
    rise = across.T @ mass_2 @ across  # half of I's second derivative
    rise[:n, :n] += mass_1[2:, 2:]
    # along the arm a point comes in by x alpha^2 / 2 + w alpha, at the distance L1 + x
    far = mass_2 @ (length_1 * moved + turned)
    rise[n, n] -= far @ turned
    rise[n, n + 1 :] -= far[2:]
    rise[n + 1 :, n] -= far[2:]
    stiffness = np.zeros((2 * n, 2 * n))
    stiffness[:n, :n], stiffness[n:, n:] = stiffness_1[2:, 2:], stiffness_2[2:, 2:]
    bends = np.delete(np.arange(2 * n + 1), n)  # alpha has no stiffness and takes its own balance
    softening = rise[np.ix_(bends, bends)] - np.outer(rise[bends, n], rise[n, bends]) / rise[n, n]
    return float(1.0 / np.sqrt(eigh(softening, stiffness, eigvals_only=True)[-1]))


def _beam(length: float, elements: int, rho: float, rigidity: float) -> tuple[Array, Array]:
    """Mass and stiffness across, in deflection and slope of every node. Shape (2 elements + 2,) twice each."""
    h, n = length / elements, 2 * elements + 2
    scale = np.tile([1.0, h], 2)
    mass, stiffness = np.zeros((n, n)), np.zeros((n, n))
    for e in range(elements):
        at = slice(2 * e, 2 * e + 4)
        mass[at, at] += rho * h * scale[:, None] * ACROSS * scale
        stiffness[at, at] += rigidity / h**3 * scale[:, None] * BENDING * scale
    return mass, stiffness
