"""The sixteen-second job by scipy: the paper's arm under IFDC with a collocated sensor, by `solve_ivp`.

Written as a user would by hand from the equations (`physics.dynamics` and `control.jacobian_transpose` name the
symbols), for one mode a link, the paper's C_r and lambda = 1, and stopped at each corner, where the reference's
velocity jumps: what a variable-step method needs to do well. The right-hand side runs as plain numpy or compiled by
numba.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from flexarm_env import FlexibleArm, LawParameters, ReferencePath
from flexarm_env.codegen.cache import kept_on_disk

Array = NDArray[np.float64]


def solve(
    arm: FlexibleArm,
    law: LawParameters,
    path: ReferencePath,
    start: Array,
    seconds: float,
    tolerance: float = 1e-6,
    compiled: bool = False,
) -> Array:
    """Return the paper's arm's public state after so many seconds of one lap at most. Shape (8,).

    The tolerance is relative and absolute; the right-hand side is compiled by numba if asked for.
    """
    k = arm.constants
    one_mode = [x for field in k for x in (field if isinstance(field, tuple) else [field])]
    numbers = (*arm.parameters.link_lengths, law.proportional_gain, law.derivative_gain, *one_mode)
    rate = _rate if compiled else _plain_rate
    state = arm.internal_state(start)
    for (begin, *corner), (end, *goal) in zip(path.table[:-1], path.table[1:], strict=True):
        if begin >= seconds:
            break
        velocity = (np.array(goal) - corner) / (end - begin)
        data = (np.array(corner) - begin * velocity, velocity, numbers)
        # LSODA was the fastest stiff method here, before BDF and Radau
        span = (begin, min(end, seconds))
        solution = solve_ivp(rate, span, state, "LSODA", rtol=tolerance, atol=tolerance, args=data)
        if not solution.success:
            raise RuntimeError(f"solve_ivp: {solution.message}")
        state = solution.y[:, -1]
    return arm.public_state(state)


def _plain_rate(t: float, state: Array, origin: Array, velocity: Array, numbers: tuple[Any, ...]) -> Array:
    """d(y, v)/dt while the reference is at ``origin + velocity t``; `numbers`: lengths, gains, `Constants`."""
    L1, L2, Kp, Kd, _, I1, I2, S2, _, _, value, slope, c1, c2, p2, k1, k2, _, _, m1, m2, t2 = numbers
    y, v = state[:4], state[4:]
    theta1, theta2 = y[0], y[2] - y[0] - slope * y[1]
    rate1, rate2 = v[0], v[2] - v[0] - slope * v[1]
    s1, c_1, s12, c12 = math.sin(theta1), math.cos(theta1), math.sin(theta1 + theta2), math.cos(theta1 + theta2)
    tip = np.array([L1 * c_1 + L2 * c12, L1 * s1 + L2 * s12])  # (8), (9)
    J = np.array([[-tip[1], -L2 * s12], [tip[0], L2 * c12]])  # (13)
    tip_rate = J[:, 0] * rate1 + J[:, 1] * rate2
    force = Kp * (origin + velocity * t - tip) + Kd * (velocity - tip_rate)  # (10), and C_r (7):
    coriolis = S2 * L1 * math.sin(theta2)
    shoulder = J[0, 0] * force[0] + J[1, 0] * force[1] + coriolis * (2.0 * rate1 + rate2) * rate2
    elbow = J[0, 1] * force[0] + J[1, 1] * force[1] - coriolis * rate1 * rate1

    cos, sin = math.cos(y[2] - y[0]), math.sin(y[2] - y[0])
    deflection, momentum = value * y[1], p2 * y[3]
    along, across = L1 * cos + deflection * sin, L1 * sin - deflection * cos
    a, b = S2 * along - momentum * across, value * (S2 * cos - momentum * sin)
    c, d = p2 * along, p2 * value * cos
    M = np.array(
        [
            [I1 + m1 * y[1] * y[1], c1, a, c],
            [c1, m1, b, d],
            [a, b, I2 + t2 * y[3] * y[3], c2],
            [c, d, c2, m2],
        ]
    )
    right = np.array([shoulder - elbow, -slope * elbow - k1 * y[1], elbow, -k2 * y[3]])
    return np.concatenate((v, np.linalg.solve(M, right)))


_rate = kept_on_disk(__file__, "the right-hand side for scipy")(_plain_rate)
