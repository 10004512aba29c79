"""Compiled parts of a real-time iteration: the cost of a prediction to second order, and that of several runs.

The functions call nothing outside this file (`kept_on_disk`). Shapes: n entries of a state, r residuals, N periods.
"""

from __future__ import annotations

from flexarm_baselines.arrays import Floats
from flexarm_env.codegen.cache import kept_on_disk

compiled = kept_on_disk(__file__, "the cost of predictions")


@compiled
def expand(residuals: Floats, by_state: Floats, weights: Floats, gradient: Floats, hessian: Floats) -> None:
    """Expand a sum of weighted squares about states, with Gauss-Newton's curvature.

    Args:
        residuals: of each state. Shape (N + 1, r).
        by_state: their derivatives. Shape (N + 1, r, n).
        weights: on their squares. Shape (N + 1, r).
        gradient: receives the slope by the states. Shape (N + 1, n).
        hessian: receives the curvature. Shape (N + 1, n, n).
    """
    size = by_state.shape[2]
    for t in range(residuals.shape[0]):
        gradient[t] = 0.0
        hessian[t] = 0.0
        for k in range(residuals.shape[1]):
            if weights[t, k] != 0.0:
                for i in range(size):
                    slope = 2.0 * weights[t, k] * by_state[t, k, i]
                    gradient[t, i] += slope * residuals[t, k]
                    for j in range(size):
                        hessian[t, i, j] += slope * by_state[t, k, j]


@compiled
def costs(
    residuals: Floats, weights: Floats, torques: Floats, before: Floats, torque_weights: Floats, result: Floats
) -> None:
    """Add up the cost of several runs, without that of what follows their end.

    Args:
        residuals: see `expand`. Shape (runs, N + 1, r).
        weights: see `expand`. Shape (runs, N + 1, r).
        torques: of each period [N m]. Shape (runs, N, 2).
        before: of the period before the first. Shape (2,).
        torque_weights: on squared torques, and on their squared changes. Shape (2, 2).
        result: receives the costs. Shape (runs,).
    """
    for run in range(residuals.shape[0]):
        total = 0.0
        for t in range(residuals.shape[1]):
            for k in range(residuals.shape[2]):
                total += weights[run, t, k] * residuals[run, t, k] ** 2
        for t in range(torques.shape[1]):
            for k in range(2):
                last = before[k] if t == 0 else torques[run, t - 1, k]
                total += torque_weights[0, k] * torques[run, t, k] ** 2
                total += torque_weights[1, k] * (torques[run, t, k] - last) ** 2
        result[run] = total
