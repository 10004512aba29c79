"""Backward sweeps of dynamic programming through quadratic models of runs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal import kernels


class Model(NamedTuple):
    """Runs of N periods with their dynamics to first order and their cost to second order; n entries of a state.

    Leading axes, of any number, are those of the runs.

    Attributes:
        by_state: derivatives of each period's end by the state. Shape (..., N, n, n).
        by_torque: by the torque. Shape (..., N, n, 2).
        gradient: of the cost, by each state. Shape (..., N + 1, n).
        hessian: Shape (..., N + 1, n, n).
        weights: on squared torques, and on their squared changes, of all runs. Shape (2, 2).
        torques: of the period before the first, then of each. Shape (..., N + 1, 2).
        defects: by how much each period ends beyond the next state; None: the runs follow the dynamics.
            Shape (..., N, n).
        curvature: of the dynamics, see `kernels.Runs`; None: 0. Shape (..., N, n + 2, n + 2).
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
        forward: changes of the torques. Shape (..., N, 2).
        gains: on z. Shape (..., N, 2, n + 2).
        cost_to_go: of each instant. Shapes (..., N + 1, n + 2), (..., N + 1, n + 2, n + 2).
        expected: first- and second-order part of the change of the cost that the model expects. Shape (..., 2).
    """

    forward: Floats
    gains: Floats
    cost_to_go: CostToGo
    expected: Floats


def sweep(
    model: Model,
    limits: Floats | None = None,
    regularisation: Floats | None = None,
    beyond: CostToGo | None = None,
) -> Sweep:
    """Minimise the model's cost over the torques, of each run for itself.

    Args:
        model: the model.
        limits: largest torques; None: no limit. Shape (2,).
        regularisation: added to the curvature by each torque; None: 0. Shape (2,).
        beyond: cost of what follows each run's end; None: 0. Shapes (..., n + 2), (..., n + 2, n + 2).
    """
    *leading, periods, n, _ = model.by_torque.shape
    forward, gains = np.empty((*leading, periods, 2)), np.empty((*leading, periods, 2, n + 2))
    cost = CostToGo(np.empty((*leading, periods + 1, n + 2)), np.empty((*leading, periods + 1, n + 2, n + 2)))
    cost.slopes[..., -1, :] = 0.0 if beyond is None else beyond.slopes
    cost.curvatures[..., -1, :, :] = 0.0 if beyond is None else beyond.curvatures
    expected = np.empty((*leading, 2))

    def runs(table: Floats) -> Floats:
        """Put the runs on one axis before the last ones."""
        return np.ascontiguousarray(table).reshape(-1, *table.shape[len(leading) :])

    problem = kernels.Runs(
        by_state=runs(model.by_state),
        by_torque=runs(model.by_torque),
        defects=runs(np.zeros((*leading, 1, n)) if model.defects is None else model.defects),
        gradient=runs(model.gradient),
        hessian=runs(model.hessian),
        curvature=runs(np.zeros((*leading, 1, n + 2, n + 2)) if model.curvature is None else model.curvature),
        weights=model.weights,
        torques=runs(model.torques),
        limits=np.full(2, np.inf) if limits is None else limits,
        regularisation=np.zeros(2) if regularisation is None else regularisation,
    )
    tables = forward, gains, cost.slopes, cost.curvatures, expected
    kernels.backward(problem, kernels.Solution(*map(runs, tables)))
    return Sweep(forward, gains, cost, expected)
