"""Compiled parts of a real-time iteration: the cost of predictions to second order, and that of candidates.

A prediction's cost over its horizon is a sum of weighted squares: of the tip's errors, and of the links' deflections
beyond their limit, but for its last instant, whose cost is in that of what follows. The functions call nothing outside
this file (`kept_on_disk`). Shapes: R arms, n entries of a state, N periods.
"""

from __future__ import annotations

from typing import NamedTuple

from flexarm_baselines.arrays import Floats
from flexarm_env.codegen.cache import kept_on_disk

compiled = kept_on_disk(__file__, "the cost of predictions")


class Wanted(NamedTuple):
    """What predictions are to do.

    Attributes:
        reference: where the tip should be [m]. Shape (R, N + 1, 2).
        tip_weights: on the tip's squared errors. Shape (R, N + 1).
        deflection_weight: on squared deflections beyond the limit.
        deflection_limit: [m].
    """

    reference: Floats
    tip_weights: Floats
    deflection_weight: float
    deflection_limit: float


@compiled
def excess(deflection: float, limit: float) -> float:
    """Return by how much a deflection is beyond a limit on its magnitude."""
    return deflection - min(max(deflection, -limit), limit)


@compiled
def add_square(residual: float, by_state: Floats, weight: float, gradient: Floats, hessian: Floats) -> None:
    """Add a weighted square to a cost, with Gauss-Newton's curvature.

    Args:
        residual: whose square it is.
        by_state: its derivatives. Shape (n,).
        weight: on its square.
        gradient: of the cost. Shape (n,).
        hessian: Shape (n, n).
    """
    for i in range(by_state.shape[0]):
        slope = 2.0 * weight * by_state[i]
        gradient[i] += slope * residual
        if slope != 0.0:  # most entries of a state do not move the point
            for j in range(by_state.shape[0]):
                hessian[i, j] += slope * by_state[j]


@compiled
def expand(
    tip: Floats,
    tip_slopes: Floats,
    deflection: Floats,
    deflection_slopes: Floats,
    wanted: Wanted,
    gradient: Floats,
    hessian: Floats,
) -> None:
    """Expand the cost of predicted states about them.

    Args:
        tip: at each instant [m]. Shape (R, N + 1, 2).
        tip_slopes: its derivatives by the states. Shape (R, N + 1, 2, n).
        deflection: of each link's tip [m]. Shape (R, N + 1, 2).
        deflection_slopes: its derivatives by the states. Shape (R, N + 1, 2, n).
        wanted: what they are to do.
        gradient: receives the slope by the states. Shape (R, N + 1, n).
        hessian: receives the curvature. Shape (R, N + 1, n, n).
    """
    reference, tip_weights, weight, limit = wanted
    gradient[:] = 0.0
    hessian[:] = 0.0
    for run in range(tip.shape[0]):
        for t in range(tip.shape[1] - 1):
            for k in range(2):
                error = tip[run, t, k] - reference[run, t, k]
                slopes = tip_slopes[run, t, k]
                add_square(error, slopes, tip_weights[run, t], gradient[run, t], hessian[run, t])
                beyond = excess(deflection[run, t, k], limit)
                if beyond != 0.0:
                    slopes = deflection_slopes[run, t, k]
                    add_square(beyond, slopes, weight, gradient[run, t], hessian[run, t])


@compiled
def costs(
    tip: Floats,
    deflection: Floats,
    wanted: Wanted,
    torques: Floats,
    before: Floats,
    torque_weights: Floats,
    result: Floats,
) -> None:
    """Add up the cost of candidates, without that of what follows their end.

    Args:
        tip: see `expand`. Shape (R, candidates, N + 1, 2).
        deflection: see `expand`. Shape (R, candidates, N + 1, 2).
        wanted: see `expand`.
        torques: of each period [N m]. Shape (R, candidates, N, 2).
        before: of the period before the first. Shape (R, 2).
        torque_weights: on squared torques, and on their squared changes. Shape (2, 2).
        result: receives the costs. Shape (R, candidates).
    """
    reference, tip_weights, weight, limit = wanted
    for run in range(torques.shape[0]):
        for n in range(torques.shape[1]):
            total = 0.0
            for t in range(torques.shape[2]):
                for k in range(2):
                    total += tip_weights[run, t] * (tip[run, n, t, k] - reference[run, t, k]) ** 2
                    total += weight * excess(deflection[run, n, t, k], limit) ** 2
                    last = before[run, k] if t == 0 else torques[run, n, t - 1, k]
                    total += torque_weights[0, k] * torques[run, n, t, k] ** 2
                    total += torque_weights[1, k] * (torques[run, n, t, k] - last) ** 2
            result[run, n] = total
