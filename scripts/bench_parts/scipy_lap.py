"""The sixteen-second job by scipy: the paper's arm under IFDC with a collocated sensor, in numpy and `solve_ivp`.

Written as a user would by hand from the equations (`flexarm_env.dynamics` and `closed_loop` name the symbols), for
one mode a link, the paper's C_r and lambda = 1, and stopped at each corner, where the reference's velocity jumps:
what a variable-step method needs to do well.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from flexarm_env import FlexibleArm, LawParameters, Path

Array = NDArray[np.float64]
Rate = Callable[[float, Array], Array]


def solve(arm: FlexibleArm, law: LawParameters, path: Path, start: Array, seconds: float, tolerance: float) -> Array:
    """Public state after so many seconds. Shape (8,).

    Args:
        arm: the paper's.
        law: gains.
        path: the reference; one lap at most.
        start: public state. Shape (8,).
        seconds: [s].
        tolerance: relative and absolute.
    """
    state = arm.internal_state(start)
    for (begin, *corner), (end, *goal) in zip(path.table[:-1], path.table[1:], strict=True):
        if begin >= seconds:
            break
        velocity = (np.array(goal) - corner) / (end - begin)
        rate = _rate(arm, law, np.array(corner) - begin * velocity, velocity)
        span = (begin, min(end, seconds))
        # LSODA was the fastest stiff method here, before BDF and Radau
        solution = solve_ivp(rate, span, state, method="LSODA", rtol=tolerance, atol=tolerance)
        if not solution.success:
            raise RuntimeError(f"solve_ivp: {solution.message}")
        state = solution.y[:, -1]
    return arm.public_state(state)


def _rate(arm: FlexibleArm, law: LawParameters, origin: Array, velocity: Array) -> Rate:
    """d(y, v)/dt while the reference is at ``origin + velocity t``."""
    k = arm.constants
    L1, L2 = arm.parameters.link_lengths
    Kp, Kd = law.proportional_gain, law.derivative_gain
    (value,), (slope,), (momentum_2,) = k.elbow_values, k.elbow_slopes, k.momentum_2
    (c1,), (c2,), (m1,), (m2,), (t2,) = k.coupling_1, k.coupling_2, k.mass_1, k.mass_2, k.translation_2
    stiffness = np.array([0.0, k.stiffness_1[0], 0.0, k.stiffness_2[0]])
    to_joints = np.array([[1.0, 0.0, 0.0, 0.0], [-1.0, -slope, 1.0, 0.0]])  # and its transpose is B

    def mass_matrix(y: Array) -> Array:
        cos, sin = math.cos(y[2] - y[0]), math.sin(y[2] - y[0])
        deflection, momentum = value * y[1], momentum_2 * y[3]
        along, across = L1 * cos + deflection * sin, L1 * sin - deflection * cos
        a = k.static_moment_2 * along - momentum * across
        b = value * (k.static_moment_2 * cos - momentum * sin)
        c, d = momentum_2 * along, momentum_2 * value * cos
        inertia_1, inertia_2 = k.inertia_1 + m1 * y[1] ** 2, k.inertia_2 + t2 * y[3] ** 2
        return np.array([[inertia_1, c1, a, c], [c1, m1, b, d], [a, b, inertia_2, c2], [c, d, c2, m2]])

    def rate(t: float, state: Array) -> Array:
        y, v = state[:4], state[4:]
        theta1, theta2 = to_joints @ y
        rates = to_joints @ v
        s1, c1, s12, c12 = math.sin(theta1), math.cos(theta1), math.sin(theta1 + theta2), math.cos(theta1 + theta2)
        tip = np.array([L1 * c1 + L2 * c12, L1 * s1 + L2 * s12])  # (8), (9)
        J = np.array([[-tip[1], -L2 * s12], [tip[0], L2 * c12]])  # (13)
        tau = J.T @ (Kp * (origin + velocity * t - tip) + Kd * (velocity - J @ rates))  # (10)
        coriolis = k.static_moment_2 * L1 * math.sin(theta2)
        C_r = np.array([-coriolis * (2.0 * rates[0] + rates[1]) * rates[1], coriolis * rates[0] ** 2])  # (7)
        return np.concatenate([v, np.linalg.solve(mass_matrix(y), to_joints.T @ (tau - C_r) - stiffness * y)])

    return rate
