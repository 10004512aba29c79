"""What sensors read of the arm and where its tip is, with derivatives by the state: the formulas on dual numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.tangents import jacobian
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics import sensing
from flexarm_env.physics.bent_link import PointShape
from flexarm_env.physics.constants import Constants

Array = NDArray[np.float64]


class Outputs(NamedTuple):
    """Outputs of an arm, or their derivatives by its state.

    Attributes:
        joints: theta1, theta2 [rad] and their rates [rad/s], what encoders read. Shape (..., 4).
        sensed: position of the sensor's point [m] and its velocity [m/s]. Shape (..., 4).
        true_tip: with deflection [m]. Shape (..., 2).
        rigid_tip: by rigid kinematics of the joint angles (8), (9) [m]. Shape (..., 2).
        deflection: deflection of each link's tip off its root tangent [m]. Shape (..., 2).
        deflection_rate: [m/s]. Shape (..., 2).
    """

    joints: Array
    sensed: Array
    true_tip: Array
    rigid_tip: Array
    deflection: Array
    deflection_rate: Array


def output_jacobians(k: Constants, tip: PointShape, sensor: PointShape, state: Array) -> tuple[Outputs, Outputs]:
    """Compute the outputs and their derivatives.

    Args:
        k: constants of the arm.
        tip: tip of link 2.
        sensor: where the sensor is on link 2.
        state: public. Shape (..., 4 + 4 m).

    Returns:
        Outputs, and each with its derivatives by the state's entries along a new last axis.
    """
    sizes = (4, 4, 2, 2, 2, 2)

    def outputs(x: Sequence[Any]) -> list[Any]:
        """All in order."""
        y, v = (dyn.internal_coordinates(k, half) for half in (x[: len(x) // 2], x[len(x) // 2 :]))
        truth = sensing.truth(k, tip, y, v)
        joints = sensing.reading(k, sensor, "rigid", y, v)
        sensed = sensing.reading(k, sensor, "true", y, v)
        return [x for group in (joints, sensed, *truth[1:]) for x in group]

    values, derivatives = jacobian(outputs, state)
    ends = np.cumsum(sizes)[:-1]
    return Outputs(*np.split(values, ends, axis=-1)), Outputs(*np.split(derivatives, ends, axis=-2))
