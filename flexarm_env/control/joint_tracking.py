"""The inner joint-space tracking law of the environments, as plain functions of numbers (see `dynamics`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flexarm_env.physics.constants import Constants
from flexarm_env.physics.dynamics import joint_angles

Pair = Sequence[Any]


def interpolated(start: Sequence[Any], end: Sequence[Any], basis: Sequence[Any]) -> list[Any]:
    """Interpolate two coordinates and their rates between two instants, by cubic Hermite polynomials.

    Args:
        start: coordinates, then rates, at the first instant.
        end: the same at the second.
        basis: four factors for the coordinates (start, start's rate, end, end's rate) and four for the rates.
    """
    rows = (basis[:4], basis[4:])
    return [
        row[0] * start[j] + row[1] * start[2 + j] + row[2] * end[j] + row[3] * end[2 + j]
        for row in rows
        for j in (0, 1)
    ]


def tracking_torque(
    k: Constants,
    gains: tuple[Pair, Pair],
    aim: Sequence[Any],
    residual: Pair,
    state: tuple[Sequence[Any], Sequence[Any]],
) -> list[Any]:
    """Compute the joint-space tracking law: a spring and a damper between each joint and its aim, and a residual.

    Args:
        k: constants of the arm.
        gains: stiffness [N m/rad] and damping [N m s/rad] of the two joints.
        aim: joint angles and rates to be followed.
        residual: torque added [N m].
        state: y and v.
    """
    angles, rates = joint_angles(k, state[0]), joint_angles(k, state[1])
    return [residual[j] + gains[0][j] * (aim[j] - angles[j]) + gains[1][j] * (aim[2 + j] - rates[j]) for j in (0, 1)]
