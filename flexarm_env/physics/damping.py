"""How much the links' damping is: one ratio, whatever the model.

The ratio zeta (`ArmParameters.damping_ratio`) is that of the first elastic mode of the free arm: both joints turn
freely and without friction, links are straight and in line (theta2 = 0); hubs, elbow mass and housing are in place, the
payload is not. To first order in the damping it is ``phi^T D phi / (2 omega)`` with the undamped mode phi,
``phi^T M phi = 1``, and its frequency omega; for "material" damping that is exact. The mode is computed from
`MAX_MODES` polynomials a link, whatever shapes the arm itself has, so that arms which differ in their shapes alone,
and the chain of segments, have the same damping.

    "material": D = beta K (Kelvin-Voigt), beta = 2 zeta / omega. The mode i of any arm of this material has the
        ratio zeta omega_i / omega.
    "modal": each clamped mode of a bare link is damped by 2 c zeta omega_i m_i, with one factor c for all.

A drawn stiffness s multiplies omega by its root; since zeta is the ratio at that stiffness, D then grows with the root
of s in both models.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.parameters import MAX_MODES, ArmParameters
from flexarm_env.physics.link_modes import LinkModes, Shapes, link_modes

Array = NDArray[np.float64]
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)  # products of two polynomials of degree 5 are exact
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


class UnitDamping(NamedTuple):
    """Damping of an arm whose ratio zeta is 1.

    Attributes:
        material_time: beta, damping over stiffness with the model "material" [s].
        clamped_ratio: c, ratio of each clamped mode with the model "modal".
        frequency: omega of the free arm's first elastic mode [rad/s].
    """

    material_time: float
    clamped_ratio: float
    frequency: float


def unit_damping(parameters: ArmParameters) -> UnitDamping:
    """Return the damping that an arm has with a ratio of 1, whatever its own is."""
    p = parameters
    return _unit_damping(
        p.link_lengths, p.flexural_rigidities, p.masses_per_length, p.shoulder_hub_inertia, p.elbow_hub_inertia,
        p.elbow_mass, p.elbow_housing_inertia,
    )  # fmt: skip


def link_damping(parameters: ArmParameters, link: LinkModes) -> Array:
    """Return the damping of the shapes of a link, the diagonal of D [N m s]. Shape (m,)."""
    if parameters.damping_model == "material":
        return material_time(parameters) * link.stiffness
    return 2.0 * clamped_ratio(parameters) * link.frequencies * np.diag(link.mass)


def material_time(parameters: ArmParameters) -> float:
    """Return beta, damping over stiffness with the model "material" [s]."""
    return parameters.damping_ratio * unit_damping(parameters).material_time


def clamped_ratio(parameters: ArmParameters) -> float:
    """Return the ratio of each clamped mode of a bare link with the model "modal"."""
    return parameters.damping_ratio * unit_damping(parameters).clamped_ratio


@lru_cache(maxsize=256)
def _unit_damping(
    lengths: tuple[float, float],
    rigidities: tuple[float, float],
    densities: tuple[float, float],
    shoulder_hub_inertia: float,
    elbow_hub_inertia: float,
    elbow_mass: float,
    elbow_housing_inertia: float,
) -> UnitDamping:
    """See `unit_damping`.

    The mass matrix is V^T V with a row of V for each mass, its velocity by the rates of (a1, a2, q1, q2) times the root
    of the mass. A QR factorisation of V takes the rigid motions out without forming the matrix, so that no digits are
    lost between masses that lie far apart. What remains of it, R, and the stiffness K give the modes: the largest
    singular value of R K^(-1/2) is 1 / omega.
    """
    one, two = (
        link_modes(length, rigidity, density, MAX_MODES, length, "polynomial")
        for length, rigidity, density in zip(lengths, rigidities, densities, strict=True)
    )
    motion = _motion(one.shapes, two.shapes, lengths)
    masses = np.concatenate([
        densities[0] * lengths[0] * _WEIGHTS,
        densities[1] * lengths[1] * _WEIGHTS,
        [shoulder_hub_inertia, elbow_hub_inertia, elbow_mass],
    ])  # fmt: skip
    if elbow_housing_inertia:
        turn = np.concatenate([[1.0, 0.0], one.tip_slopes, np.zeros(MAX_MODES)])
        motion, masses = np.vstack([motion, turn]), np.append(masses, elbow_housing_inertia)
    elastic = np.linalg.qr(np.sqrt(masses)[:, None] * motion).R[2:, 2:]
    root = np.sqrt(np.concatenate([one.stiffness, two.stiffness]))
    _, singular, right = np.linalg.svd(elastic / root)
    frequency = float(1.0 / singular[0])
    squared = (right[0] * frequency / root) ** 2  # of the mode with a modal mass of 1
    clamped = np.concatenate([2.0 * link.frequencies * np.diag(link.mass) for link in (one, two)])
    return UnitDamping(2.0 / frequency, float(2.0 * frequency / (squared @ clamped)), frequency)


@lru_cache
def _motion(first: Shapes, second: Shapes, lengths: tuple[float, float]) -> Array:
    """Return the velocity of each mass across the straight arm by the rates. Shape (masses, 2 + 2 `MAX_MODES`)."""
    none, no_shapes = np.zeros(len(_NODES)), np.zeros((len(_NODES), MAX_MODES))
    elbow = np.concatenate([[lengths[0], 0.0], first(np.array(lengths[0]), 0), np.zeros(MAX_MODES)])
    on_1 = np.column_stack([_NODES * lengths[0], none, first(_NODES * lengths[0], 0), no_shapes])
    on_2 = elbow + np.column_stack([none, _NODES * lengths[1], no_shapes, second(_NODES * lengths[1], 0)])
    return np.concatenate([on_1, on_2, np.eye(2, 2 + 2 * MAX_MODES), elbow[None]])
