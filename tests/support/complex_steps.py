"""The Runge-Kutta method on complex numbers of extended precision: derivatives without a rule of differentiation.

Source: Squire & Trapp, *Using complex variables to estimate derivatives of real functions*, SIAM Review 40 (1998).
"""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np

from flexarm_env import FlexibleArm, formulas
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
    """Public state after some steps, by the plain formulas (`formulas.step`); arguments may be complex."""
    flat = arm.changes.constants(np.asarray(quantities)[None])[0]
    own, modes = arm.constants, arm.parameters.modes_per_link
    k = Constants.unflat(list(flat), modes, own.foreshortened, own.dry)
    other: Any = SimpleNamespace(constants=k, size=arm.size, parameters=arm.parameters)
    x = np.asarray(state, dtype=np.clongdouble)
    for _ in range(steps):
        x = np.array(formulas.step(other, x, torque, h, np.sin, np.cos))
    return x
