"""Motors that lag, before a linear plant."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from flexarm_env.analysis.plant import Plant
from flexarm_env.validation import finite_array


def behind_motors(plant: Plant, time_constants: ArrayLike) -> Plant:
    """Put motors that lag by first order before a plant: ``T tau' = u - tau``.

    Args:
        plant: with the arm's own state.
        time_constants: T of each input; 0: an ideal motor [s]. Shape (inputs,).

    Raises:
        ValueError: for a negative one, or a plant that has motors or a Pade model already.
    """
    times = finite_array("time_constants", time_constants, (plant.B.shape[1],))
    if times.min() < 0.0 or not plant.is_mechanical:
        raise ValueError(f"time_constants = {times.tolist()} s: must be at least 0, and given once, before `pade`")
    lag = np.flatnonzero(times)
    a = np.block([[plant.A, plant.B[:, lag]], [np.zeros((len(lag), len(plant.A))), -np.diag(1.0 / times[lag])]])
    b = np.vstack([plant.B * (times == 0.0), np.eye(len(times))[lag] / times[lag, None]])
    c = np.pad(plant.C, ((0, 0), (0, len(lag))))
    return replace(plant, A=a, B=b, C=c, motors=tuple(plant.inputs[n] for n in lag))
