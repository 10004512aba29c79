"""The derivative of a run's cost by its torques, by one sweep of the adjoint; compiled, nothing allocated but two rows.

Shapes: n entries of a state, N periods.
"""

from __future__ import annotations

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_env.codegen.cache import kept_on_disk

compiled = kept_on_disk(__file__, "gradients by the torques")
TORQUES = 2


@compiled
def torque_gradient(
    by_state: Floats,
    by_torque: Floats,
    gradient: Floats,
    weights: Floats,
    torques: Floats,
    gains: Floats,
    result: Floats,
    slopes: Floats,
) -> None:
    """Differentiate the cost of a trajectory by its feed-forward torques, by the adjoint.

    The trajectory follows the dynamics.

    Feedback acts on what a changed torque leads to. Without it a small change early in a lap grows too large for its
    derivative to say much. Where the derivative vanishes, it does so with any feedback.

    Args:
        by_state: see `kernels.Model`.
        by_torque: see `kernels.Model`.
        gradient: see `kernels.Model`.
        weights: see `kernels.Model`.
        torques: see `kernels.Model`.
        gains: of the feedback on z. Shape (N, 2, n + 2).
        result: receives the derivative. Shape (N, 2).
        slopes: receives that by the state at each period's end. Shape (N, n).
    """
    periods, n = by_torque.shape[0], by_state.shape[1]
    adjoint, before = np.zeros(n + TORQUES), np.zeros(n + TORQUES)
    for i in range(n):
        adjoint[i] = gradient[periods, i]
    for t in range(periods - 1, -1, -1):
        for k in range(TORQUES):
            change = torques[t + 1, k] - torques[t, k]
            total = 2.0 * (weights[0, k] * torques[t + 1, k] + weights[1, k] * change) + adjoint[n + k]
            for m in range(n):
                total += by_torque[t, m, k] * adjoint[m]
            result[t, k] = total
            before[n + k] = -2.0 * weights[1, k] * change
        for i in range(n):
            slopes[t, i] = adjoint[i]
            total = gradient[t, i]
            for m in range(n):
                total += by_state[t, m, i] * adjoint[m]
            before[i] = total
        for i in range(n + TORQUES):
            adjoint[i] = before[i] + gains[t, 0, i] * result[t, 0] + gains[t, 1, i] * result[t, 1]
