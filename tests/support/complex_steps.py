"""The Runge-Kutta method on complex numbers of extended precision: derivatives without a rule of differentiation.

Source: Squire & Trapp, *Using complex variables to estimate derivatives of real functions*, SIAM Review 40 (1998).
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from flexarm_env import FlexibleArm
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics.constants import Constants

# The derivative of an analytic f is Im f(x + i STEP) / STEP, and no digits are lost to cancellation.
STEP = 1e-30
Numbers = np.ndarray[Any, Any]


def jacobian(function: Callable[[Numbers], Numbers], at: Numbers) -> Numbers:
    """Compute derivatives of a function of some numbers. Shape (results, numbers)."""
    columns = []
    for n in range(len(at)):
        moved = np.array(at, dtype=np.clongdouble)
        moved[n] += 1j * STEP
        columns.append(np.imag(function(moved)) / STEP)
    return np.array(np.stack(columns, axis=1), dtype=float)


def stepped(arm: FlexibleArm, state: Numbers, torque: Numbers, quantities: Numbers, h: float, steps: int) -> Numbers:
    """Public state after some steps, by the plain formulas and a factorisation of M; arguments may be complex."""
    flat = arm.changes.constants(np.asarray(quantities)[None])[0]
    own = arm.constants
    k = Constants.unflat(list(flat), arm.parameters.modes_per_link, own.foreshortened, own.dry)
    complete = arm.parameters.velocity_forces == "complete"

    def inertia(y: Numbers) -> Any:
        turn = dyn.elbow_turn(y)
        return dyn.inertia(k, None, list(y), np.cos(turn), np.sin(turn))

    def rate(x: Numbers) -> Numbers:
        y, p = np.split(x, 2)
        turn, theta2 = dyn.elbow_turn(y), dyn.joint_angles(k, y)[1]
        v = dyn.solve(k, None, inertia(y), list(p))
        angles = (np.cos(turn), np.sin(turn), np.sin(theta2))
        return np.array([*v, *dyn.momentum_rate(k, complete, list(y), v, list(torque), angles)])

    y, v = np.split(arm.internal_state(np.asarray(state, dtype=np.clongdouble)), 2)
    turn = dyn.elbow_turn(y)
    x = np.array([*y, *dyn.momentum(k, list(y), list(v), np.cos(turn), np.sin(turn))])
    for _ in range(steps):
        a = rate(x)
        b = rate(x + 0.5 * h * a)
        c = rate(x + 0.5 * h * b)
        d = rate(x + h * c)
        x = x + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
    y, p = np.split(x, 2)
    return arm.public_state(np.array([*y, *dyn.solve(k, None, inertia(y), list(p))]))
