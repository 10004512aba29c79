"""A backward sweep of dynamic programming through a quadratic model of a run."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal import kernels


class Model(NamedTuple):
    """A run of N periods with its dynamics to first order and its cost to second order.

    Attributes:
        by_state: derivatives of each period's end by the state. Shape (N, n, n).
        by_torque: by the torque. Shape (N, n, 2).
        gradient: of the cost, by each state. Shape (N + 1, n).
        hessian: Shape (N + 1, n, n).
        weights: on squared torques, and on their squared changes. Shape (2, 2).
        torques: of the period before the first, then of each. Shape (N + 1, 2).
        defects: by how much each period ends beyond the next state; None: the run follows the dynamics. Shape (N, n).
        curvature: of the dynamics, see `kernels.backward`; None: 0. Shape (N, n + 2, n + 2).
    """

    by_state: Floats
    by_torque: Floats
    gradient: Floats
    hessian: Floats
    weights: Floats
    torques: Floats
    defects: Floats | None = None
    curvature: Floats | None = None


class CostToGo(NamedTuple):
    """The cost from some instants on, to second order in the deviation of z = (state, torque of the period before).

    Attributes:
        slopes: Shape (..., n + 2).
        curvatures: Shape (..., n + 2, n + 2).
    """

    slopes: Floats
    curvatures: Floats


class Sweep(NamedTuple):
    """What a sweep found.

    Attributes:
        forward: changes of the torques. Shape (N, 2).
        gains: on z. Shape (N, 2, n + 2).
        cost_to_go: of each instant. Shapes (N + 1, ...).
        expected: first- and second-order part of the change of the cost that the model expects.
    """

    forward: Floats
    gains: Floats
    cost_to_go: CostToGo
    expected: tuple[float, float]


def sweep(
    model: Model,
    limits: Floats | None = None,
    regularisation: Floats | None = None,
    beyond: CostToGo | None = None,
) -> Sweep:
    """Minimise the model's cost over the torques.

    Args:
        model: the model.
        limits: largest torques; None: no limit. Shape (2,).
        regularisation: added to the curvature by each torque; None: 0. Shape (2,).
        beyond: cost of what follows the run's end; None: 0. Shapes (n + 2,), (n + 2, n + 2).
    """
    periods, n, _ = model.by_torque.shape
    forward, gains = np.empty((periods, 2)), np.empty((periods, 2, n + 2))
    cost = CostToGo(np.empty((periods + 1, n + 2)), np.empty((periods + 1, n + 2, n + 2)))
    cost.slopes[-1] = 0.0 if beyond is None else beyond.slopes
    cost.curvatures[-1] = 0.0 if beyond is None else beyond.curvatures
    expected = kernels.backward(
        model.by_state,
        model.by_torque,
        np.zeros((1, n)) if model.defects is None else model.defects,
        model.gradient,
        model.hessian,
        np.zeros((1, n + 2, n + 2)) if model.curvature is None else model.curvature,
        model.weights,
        model.torques,
        np.full(2, np.inf) if limits is None else limits,
        np.zeros(2) if regularisation is None else regularisation,
        forward,
        gains,
        *cost,
    )
    return Sweep(forward, gains, cost, expected)
