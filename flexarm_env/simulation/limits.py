"""The limits of a valid state, and the state at rest."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.physics.paths import inverse_kinematics
from flexarm_env.simulation.arm import FlexibleArm

Array = NDArray[np.float64]

# [rad]; of theta1, which turns once a lap around the shoulder, a thousand turns; of theta2 four
ANGLE_LIMITS = (2000.0 * np.pi, 8.0 * np.pi)
RATE_LIMIT = 1e3  # [rad/s]
TIP_RATE_LIMIT = 1e3  # [m/s], of a link's tip by one mode


def state_limits(arm: FlexibleArm) -> Array:
    """Return the magnitudes of a valid state: angles, modal coordinates, joint rates, modal rates. Shape (4 + 4 m,).

    A modal coordinate's limit is the one that alone bends its link's tip by the link's length; a modal rate's the one
    that alone moves it at 1000 m/s.
    """
    tips = [np.abs(link.tip_values) for link in arm.modes]
    modal = np.concatenate([link.length / values for link, values in zip(arm.modes, tips, strict=True)])
    return np.concatenate([ANGLE_LIMITS, modal, np.full(2, RATE_LIMIT), TIP_RATE_LIMIT / np.concatenate(tips)])


def rest_state(arm: FlexibleArm, point: ArrayLike, elbow_branch: str = "positive") -> NDArray[np.float64]:
    """Return the state at rest with straight links and the tip at a point [m]. Shape (4 + 4 m,).

    Raises:
        ValueError: if the point is out of reach.
    """
    state = np.zeros(2 * arm.size)
    state[:2] = inverse_kinematics(arm.parameters, point, elbow_branch)
    return state
