"""The arm at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.physics.paths import inverse_kinematics
from flexarm_env.simulation.arm import FlexibleArm


def rest_state(arm: FlexibleArm, point: ArrayLike, elbow_branch: str = "positive") -> NDArray[np.float64]:
    """Return the state at rest with straight links and the tip at a point [m]. Shape (4 + 4 m,)."""
    state = np.zeros(2 * arm.size)
    state[:2] = inverse_kinematics(arm.parameters, point, elbow_branch)
    return state
