"""Rigid inverse kinematics as plain functions of numbers: the joint angles and rates that put the tip somewhere.

Recorded into kernels and compiled into them as they stand (`codegen.tracing`, `codegen.scalars`).
"""

from __future__ import annotations

from typing import Any

from flexarm_env.codegen.elementary import arctan2, sincos
from flexarm_env.codegen.tracing import at_least, floor, magnitude, root, where_less

# Near the straight and the folded arm a tip velocity requires unbounded joint rates; the sine of theta2 that divides
# them is kept at least so large. On the default square it is 0.28 at the corners.
LEAST_SINE = 0.05
STRAIGHT = 0.05  # [rad]; an elbow bent by less is on neither side. Two equal links then reach to 0.03 % of their length
TURN = 6.283185307179586


def joint_angles_for(length_1: Any, length_2: Any, branch: Any, x: Any, y: Any) -> tuple[Any, Any]:
    """Return the joint angles [rad] that put the rigid arm's tip at a point [m], or as near as it can.

    By the half angle, which keeps its digits where the arm is straight or folded; beyond its reach it is either.
    `branch`: 1 for a positive theta2, -1 for a negative one.
    """
    squared = x * x + y * y
    reach = length_1 + length_2
    hole = length_1 - length_2
    bent = root(at_least(reach * reach - squared, 0.0))
    straight = root(at_least(squared - hole * hole, 0.0))
    theta2 = 2.0 * arctan2(bent, straight) * branch
    sine, cosine = sincos(theta2)
    return arctan2(y, x) - arctan2(length_2 * sine, length_1 + length_2 * cosine), theta2


def joint_rates_for(length_1: Any, length_2: Any, theta1: Any, theta2: Any, vx: Any, vy: Any) -> tuple[Any, Any]:
    """Return the joint rates [rad/s] that move the rigid arm's tip: J^-1 v, J of (13), bounded by `LEAST_SINE`.

    Lengths in m, angles in rad, the tip's velocity in m/s.
    """
    sin_1, cos_1 = sincos(theta1)
    sine, cosine = sincos(theta2)
    sin_12, cos_12 = sin_1 * cosine + cos_1 * sine, cos_1 * cosine - sin_1 * sine
    bounded = at_least(magnitude(sine), LEAST_SINE)
    per_area = where_less(sine, 0.0, -1.0, 1.0) / (length_1 * length_2 * bounded)
    x = length_1 * cos_1 + length_2 * cos_12
    y = length_1 * sin_1 + length_2 * sin_12
    rate_1 = length_2 * (cos_12 * vx + sin_12 * vy) * per_area
    return rate_1, -(x * vx + y * vy) * per_area


def elbow_side(theta2: Any) -> Any:
    """On which side the elbow is: the sign of sin(theta2), or 0 within `STRAIGHT` of the straight and the folded arm.

    Args:
        theta2: [rad]; NaN is on neither side.
    """
    turns = theta2 * (1.0 / TURN)
    share = turns - floor(turns + 0.5)  # from the straight arm, at most half a turn
    bend = 0.25 - magnitude(magnitude(share) - 0.25)  # from the nearer of both poses
    return where_less(STRAIGHT / TURN, bend, where_less(share, 0.0, -1.0, 1.0), 0.0)
