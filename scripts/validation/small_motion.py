"""The package's arm in small motion about rest: its frequencies, for bases and numbers of modes, with joints locked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import eigh

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.parameters import ModeShapes
from scripts.validation.checks import Check
from scripts.validation.reference_models.exact_beams import Joints

Array = NDArray[np.float64]

MODES = (1, 2, 3, 4)
BASES: tuple[ModeShapes, ...] = ("cantilever", "polynomial")  # the shapes that a link may bend in


def with_modes(parameters: ArmParameters, basis: ModeShapes, modes: int) -> FlexibleArm:
    """Make the same arm, undamped, in so many shapes of a basis a link."""
    return FlexibleArm(replace(parameters, modes_per_link=modes, damping_ratio=0.0, mode_shapes=basis))


def matrices(arm: FlexibleArm, theta2: float) -> tuple[Array, Array]:
    """Mass and stiffness in public coordinates, as the arm's own linearisation has them. Shape (n, n) each."""
    n = arm.size
    state = np.zeros(2 * n)
    state[1] = theta2
    mass = arm.mass_matrix(state[:n])
    stiffness = -mass @ arm.linearise(state).A[n:, :n]
    return mass, 0.5 * (stiffness + stiffness.T)


def frequencies(arm: FlexibleArm, theta2: float, moving: Sequence[int], zeros: int, count: int) -> Array:
    """Lowest frequencies above `zeros` at 0 [rad/s], fewer than `count` if the arm has no more.

    Args:
        arm: the arm.
        theta2: elbow angle [rad].
        moving: the coordinates that are free; all others are held.
        zeros: how many of the frequencies are 0.
        count: how many are wanted.
    """
    mass, stiffness = (matrix[np.ix_(moving, moving)] for matrix in matrices(arm, theta2))
    squares = eigh(stiffness, mass, eigvals_only=True)
    return np.sqrt(squares[zeros : zeros + count])


def unlocked(arm: FlexibleArm, joints: Joints) -> list[int]:
    """Return the coordinates that are free when joints are locked."""
    return [i for i in range(arm.size) if not (i == 0 and joints.shoulder) and not (i == 1 and joints.elbow)]


def rate(sizes: ArrayLike, errors: ArrayLike) -> float:
    """p of ``error ~ size^-p``, least squares on logarithms."""
    slope, _ = np.polynomial.polynomial.polyfit(np.log(sizes), np.log(errors), 1)[::-1]
    return -float(slope)


def ritz_checks(
    group: str, name: str, least: float, rows: Sequence[Mapping[str, Any]], rounding: float
) -> tuple[Check, Check]:
    """Check what Rayleigh and Ritz imply: fewer shapes are too stiff, and less so with one more.

    Args:
        group: that the checks belong to.
        name: name of the first check.
        least: smallest relative error of any frequency.
        rows: frequencies by basis and number of modes, under "found".
        rounding: rounding error of a frequency.
    """
    within = f"(rounding {rounding:.0e})".replace("e-0", "e-")
    growth = [
        np.array(row["found"][basis][str(m + 1)])[: len(row["found"][basis][str(m)])] / row["found"][basis][str(m)] - 1
        for row in rows
        for basis in BASES
        for m in MODES[:-1]
    ]
    why = "Rayleigh and Ritz: a model of fewer shapes is stiffer, its frequencies are upper bounds"
    lower = "Rayleigh and Ritz: one more shape can only lower every frequency"
    more = "largest growth of a frequency with one more mode"
    return (
        Check(group, name, least, f"{why} {within}", least=-rounding),
        Check(group, more, np.concatenate(growth).max(), f"{lower} {within}", most=rounding),
    )
