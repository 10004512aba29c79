"""Backward sweeps of dynamic programming through quadratic models of runs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal import kernels
from flexarm_baselines.optimal.kernels import Model, Sweep
from flexarm_env.codegen.cache import call


class CostToGo(NamedTuple):
    """The cost from some instants on, to second order in the deviation of z = (state, torque of the period before).

    Attributes:
        slopes: Shape (..., n + 2).
        curvatures: Shape (..., n + 2, n + 2).
    """

    slopes: Floats
    curvatures: Floats


def sweep(
    model: Model,
    limits: Floats | None = None,
    regularisation: Floats | None = None,
    beyond: CostToGo | None = None,
) -> Sweep:
    """Minimise the cost of the quadratic model over the torques, for each run by itself.

    Args:
        model: the model.
        limits: largest torques; None: no limit. Shape (2,).
        regularisation: added to the curvature by each torque; None: 0. Shape (2,).
        beyond: cost of what follows each run's end; None: 0. Shapes (..., n + 2), (..., n + 2, n + 2).
    """
    *leading, periods, n, _ = model.by_torque.shape
    shapes = (periods, 2), (periods, 2, n + 2), (periods + 1, n + 2), (periods + 1, n + 2, n + 2), (2,)
    found = Sweep(*(np.empty((*leading, *shape)) for shape in shapes))
    found.slopes[..., -1, :] = 0.0 if beyond is None else beyond.slopes
    found.curvatures[..., -1, :, :] = 0.0 if beyond is None else beyond.curvatures
    if model.defects is None:
        model = model._replace(defects=np.zeros((*leading, 1, n)))
    if model.curvature is None:
        model = model._replace(curvature=np.zeros((*leading, 1, n + 2, n + 2)))

    def runs(table: Floats) -> Floats:
        return np.ascontiguousarray(table).reshape(-1, *table.shape[len(leading) :])

    tables = {name: runs(table) for name, table in model._asdict().items() if name != "weights"}
    bounds = kernels.Bounds(
        np.full(2, np.inf) if limits is None else limits, np.zeros(2) if regularisation is None else regularisation
    )
    call(kernels.backward, Model(weights=model.weights, **tables), bounds, Sweep(*map(runs, found)))
    return found
