"""Compiled parts of a real-time iteration: the cost about a prediction, and the linear pass forward.

Nothing but the results is allocated. The cached functions call nothing outside this file, because numba's cache does
not notice edits in other files.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from flexarm_baselines.arrays import Floats


@njit(cache=True)
def expand(
    errors: Floats,
    by_state: Floats,
    weights: Floats,
    excess: Floats,
    deflections: Floats,
    stiffness: float,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Expand ``w |tip - reference|^2 + stiffness sum excess^2`` about states, with Gauss-Newton's curvature.

    Args:
        errors: of the tip [m]. Shape (M, 2).
        by_state: their derivatives by the coordinates. Shape (M, 2, n / 2).
        weights: w of each instant [1]. Shape (M,).
        excess: of the links' deflections beyond their limit, with their sign; 0 within it [m]. Shape (M, 2).
        deflections: derivatives of the deflections by the coordinates. Shape (2, n / 2).
        stiffness: weight on squared excess [1].
        gradient: receives the slope by the states. Shape (M, n).
        hessian: receives the curvature. Shape (M, n, n).
    """
    half = by_state.shape[2]
    for t in range(errors.shape[0]):
        gradient[t] = 0.0
        hessian[t] = 0.0
        for i in range(half):
            for axis in range(2):
                slope = 2.0 * weights[t] * by_state[t, axis, i]
                gradient[t, i] += slope * errors[t, axis]
                for j in range(half):
                    hessian[t, i, j] += slope * by_state[t, axis, j]
        for link in range(2):
            if excess[t, link] != 0.0:
                for i in range(half):
                    slope = 2.0 * stiffness * deflections[link, i]
                    gradient[t, i] += slope * excess[t, link]
                    for j in range(half):
                        hessian[t, i, j] += slope * deflections[link, j]


@njit(cache=True)
def forward(
    by_state: Floats,
    by_torque: Floats,
    defects: Floats,
    steps: Floats,
    gains: Floats,
    limits: Floats,
    states: Floats,
    torques: Floats,
) -> None:
    """Move a prediction by the steps and gains of a sweep, along its linear model.

    Args:
        by_state: A of each period. Shape (N, n, n).
        by_torque: B. Shape (N, n, 2).
        defects: by how much each period ends beyond the next state. Shape (N, n).
        steps: changes of the torques. Shape (N, 2).
        gains: on the deviation of state and torque before. Shape (N, 2, n + 2).
        limits: largest magnitudes. Shape (2,).
        states: of the prediction, before and after; the first one stays. Shape (N + 1, n).
        torques: before and after. Shape (N, 2).
    """
    n = states.shape[1]
    moved, after, change = np.zeros(n), np.zeros(n), np.zeros(2)
    for t in range(torques.shape[0]):
        first, second = change[0], change[1]
        for k in range(2):
            wanted = steps[t, k] + gains[t, k, n] * first + gains[t, k, n + 1] * second
            for i in range(n):
                wanted += gains[t, k, i] * moved[i]
            torque = min(max(torques[t, k] + wanted, -limits[k]), limits[k])
            change[k] = torque - torques[t, k]
            torques[t, k] = torque
        for i in range(n):
            total = defects[t, i]
            for k in range(2):
                total += by_torque[t, i, k] * change[k]
            for j in range(n):
                total += by_state[t, i, j] * moved[j]
            after[i] = total
        for i in range(n):
            moved[i] = after[i]
            states[t + 1, i] += moved[i]
