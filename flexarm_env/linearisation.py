"""First-order expansion of a state's rate, by complex-step derivatives: exact to rounding error."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# The derivative of an analytic f is Im f(x + i STEP) / STEP, and no digits are lost to cancellation.
STEP = 1e-30


class Linearisation(NamedTuple):
    """``d(state)/dt = A (state - state0) + B (torque - torque0) + rate0`` about an operating point.

    Attributes:
        A: Shape (4 + 4 m, 4 + 4 m).
        B: Shape (4 + 4 m, 2).
        rate: d(state)/dt at the operating point, zero at an equilibrium. Shape (4 + 4 m,).
    """

    A: Array
    B: Array
    rate: Array


def linearise(rate: Callable[[Any, Any], Any], state: Array, torque: Array) -> Linearisation:
    """Linearise ``d(state)/dt = rate(state, torque)``.

    Args:
        rate: an analytic function that takes complex arrays.
        state: operating point. Shape (n,).
        torque: [N m]. Shape (2,).

    Returns:
        A, B and the rate at the point.
    """
    n = len(state)
    inputs = np.concatenate([state, torque])
    columns = []
    for i in range(len(inputs)):
        moved = inputs.astype(complex)
        moved[i] += 1j * STEP
        columns.append(rate(moved[:n], moved[n:]).imag / STEP)
    jacobian = np.stack(columns, axis=1)
    return Linearisation(jacobian[:, :n], jacobian[:, n:], rate(state, torque))
