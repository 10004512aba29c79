"""First-order expansion of a state's rate, by complex-step derivatives: exact to rounding error.

Source: Squire & Trapp, *Using complex variables to estimate derivatives of real functions*, SIAM Review 40 (1998).
"""

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

    The state is ``(q, q')`` with q the joint angles [rad] and the modal coordinates, whose unit makes mode shape times
    coordinate a deflection [m]; [q] stands for the unit of each, n = 2 + 2 m for their number.

    Attributes:
        A: blocks of (n, n): upper 0 and 1; lower left [q_i/s^2 per q_j], stiffness over mass with its sign, lower right
            [q_i/s^2 per q_j/s], damping over mass. Its eigenvalues are in rad/s. Shape (2 n, 2 n).
        B: upper block 0; lower [q_i/s^2 per N m]. Shape (2 n, 2).
        rate: d(state)/dt at the operating point: [q_i/s], then [q_i/s^2]; zero at an equilibrium. Shape (2 n,).
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
