"""Compiled parts of a real-time iteration: the cost of a prediction, to second order and of many at once.

The functions call nothing outside this file (`kept_on_disk`). Shapes: n entries of a state, the first half of them
coordinates; N periods.
"""

from __future__ import annotations

from flexarm_baselines.arrays import Floats
from flexarm_env.codegen.cache import kept_on_disk

compiled = kept_on_disk(__file__, "the cost of predictions")


@compiled
def expand(
    errors: Floats,
    by_coordinates: Floats,
    weights: Floats,
    excess: Floats,
    deflections: Floats,
    stiffness: float,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Expand ``w |error|^2 + stiffness sum excess^2`` about states, with Gauss-Newton's curvature.

    Args:
        errors: of the tip [m]. Shape (M, 2).
        by_coordinates: their derivatives. Shape (M, 2, n / 2).
        weights: w of each state [1]. Shape (M,).
        excess: of the links' deflections beyond their limit, with their sign; 0 within it [m]. Shape (M, 2).
        deflections: derivatives of the deflections by the coordinates. Shape (2, n / 2).
        stiffness: weight on squared excess [1].
        gradient: receives the slope by the states. Shape (M, n).
        hessian: receives the curvature. Shape (M, n, n).
    """
    half = by_coordinates.shape[2]
    for t in range(errors.shape[0]):
        gradient[t] = 0.0
        hessian[t] = 0.0
        for i in range(half):
            for axis in range(2):
                slope = 2.0 * weights[t] * by_coordinates[t, axis, i]
                gradient[t, i] += slope * errors[t, axis]
                for j in range(half):
                    hessian[t, i, j] += slope * by_coordinates[t, axis, j]
        for link in range(2):
            if excess[t, link] != 0.0:
                for i in range(half):
                    slope = 2.0 * stiffness * deflections[link, i]
                    gradient[t, i] += slope * excess[t, link]
                    for j in range(half):
                        hessian[t, i, j] += slope * deflections[link, j]


@compiled
def costs(
    errors: Floats,
    weights: Floats,
    excess: Floats,
    stiffness: float,
    torques: Floats,
    before: Floats,
    torque_weights: Floats,
    result: Floats,
) -> None:
    """Add up the cost of several runs, without that of what follows their end.

    Args:
        errors: of the tip at each instant [m]. Shape (runs, N + 1, 2).
        weights: see `expand`. Shape (N + 1,).
        excess: see `expand`. Shape (runs, N + 1, 2).
        stiffness: see `expand`.
        torques: of each period [N m]. Shape (runs, N, 2).
        before: of the period before the first. Shape (2,).
        torque_weights: on squared torques, and on their squared changes. Shape (2, 2).
        result: receives the costs. Shape (runs,).
    """
    for run in range(errors.shape[0]):
        total = 0.0
        for t in range(errors.shape[1]):
            for k in range(2):
                total += weights[t] * errors[run, t, k] ** 2 + stiffness * excess[run, t, k] ** 2
        for t in range(torques.shape[1]):
            for k in range(2):
                last = before[k] if t == 0 else torques[run, t - 1, k]
                total += torque_weights[0, k] * torques[run, t, k] ** 2
                total += torque_weights[1, k] * (torques[run, t, k] - last) ** 2
        result[run] = total
