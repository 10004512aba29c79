"""The paper's task put together: the square, and the start on its corner."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.parameters import SquareParameters
from flexarm_env.physics.paths import inverse_kinematics, square
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.cases import LoopCase
from flexarm_env.simulation.closed_loop import ClosedLoop
from flexarm_env.simulation.limits import state_limits

Array = NDArray[np.float64]

CONTROL_PERIOD = 1e-3  # [s]; the paper's step size


def square_loop(
    arm: FlexibleArm,
    cases: Sequence[LoopCase],
    task: SquareParameters | None = None,
    physics_step: float | None = None,
) -> tuple[ClosedLoop, Array]:
    """Make a batch of arms that track the square, and their initial states.

    Args:
        arm: the arm.
        cases: sensor and law of each.
        task: the square; default `SquareParameters()`.
        physics_step: see `ClosedLoop`.

    Returns:
        The batch, with limits on its states, and the starting states for its `reset`. Shape (N, 4 + 4 m).

    Raises:
        ValueError: if the tip cannot reach the square, with the distance by which it misses.
    """
    task = SquareParameters() if task is None else task
    path = square(task)
    path.check_reach(arm.parameters)
    loop = ClosedLoop(arm, cases, path, CONTROL_PERIOD, physics_step=physics_step, state_limits=state_limits(arm))
    return loop, np.tile(rest_state(arm, path.table[0, 1:], task.elbow_branch), (len(loop), 1))


def rest_state(arm: FlexibleArm, point: ArrayLike, elbow_branch: str = "positive") -> Array:
    """Return the state at rest with straight links and the tip at a point [m]. Shape (4 + 4 m,)."""
    state = np.zeros(2 * arm.size)
    state[:2] = inverse_kinematics(arm.parameters, point, elbow_branch)
    return state
