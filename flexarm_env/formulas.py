"""The arm's equations for other engines: plain formulas of whatever numbers they are given.

The functions below add, multiply and divide, dry friction also takes a root by ``x**0.5``; sine and cosine are handed
over. So they evaluate on numpy arrays, torch tensors, JAX arrays and CasADi symbols alike, and each engine
differentiates and compiles them in its own way:

    rate = formulas.state_rate(arm, state, torque, jnp.sin, jnp.cos)

`state` and `torque` are sequences of numbers (or of arrays, for many states at once), and so are results.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics import sensing
from flexarm_env.physics.modal_elimination import elimination
from flexarm_env.simulation.arm import FlexibleArm

Function = Callable[[Any], Any]


def state_rate(
    arm: FlexibleArm, state: Sequence[Any], torque: Sequence[Any], sin: Function, cos: Function
) -> list[Any]:
    """Return d(state)/dt of the torque-driven arm (6).

    Args:
        arm: the arm.
        state: 4 + 4 m numbers, see `FlexibleArm`.
        torque: torque of shoulder and elbow [N m].
        sin: sine of the engine.
        cos: cosine of the engine.

    Returns:
        4 + 4 m numbers.
    """
    k, n = arm.constants, arm.size
    y, v = (dyn.internal_coordinates(k, [half[i] for i in range(n)]) for half in (state[:n], state[n:]))
    turn = dyn.elbow_turn(y)
    angles = (cos(turn), sin(turn), sin(state[1]))
    complete = arm.parameters.velocity_forces == "complete"
    rates = dyn.acceleration(k, elimination(k), complete, y, v, [torque[0], torque[1]], angles)
    return [*(state[n + i] for i in range(n)), *dyn.public_coordinates(k, rates)]


def step(
    arm: FlexibleArm, state: Sequence[Any], torque: Sequence[Any], h: float, sin: Function, cos: Function
) -> list[Any]:
    """Return the state after one step of the classical Runge-Kutta method of positions and momenta, the torque held.

    `h`: the step [s]; other arguments as in `state_rate`.
    """
    k, n = arm.constants, arm.size
    e, complete = elimination(k), arm.parameters.velocity_forces == "complete"
    y, v = (dyn.internal_coordinates(k, [half[i] for i in range(n)]) for half in (state[:n], state[n:]))

    def inertia(y: list[Any]) -> Any:
        turn = dyn.elbow_turn(y)
        return dyn.inertia(k, e, y, cos(turn), sin(turn))

    turn = dyn.elbow_turn(y)
    start = [*y, *dyn.momentum(k, y, v, cos(turn), sin(turn))]
    stage, total = start, [0.0] * len(start)
    for ahead, weight in ((0.5 * h, 1.0), (0.5 * h, 2.0), (h, 2.0), (0.0, 1.0)):
        y, turn = stage[:n], dyn.elbow_turn(stage[:n])
        v = dyn.solve(k, e, inertia(y), stage[n:])
        angles = cos(turn), sin(turn), sin(dyn.joint_angles(k, y)[1])
        slope = [*v, *dyn.momentum_rate(k, complete, y, v, [torque[0], torque[1]], angles)]
        total = [a + weight * b for a, b in zip(total, slope, strict=True)]
        stage = [a + ahead * b for a, b in zip(start, slope, strict=True)]
    end = [a + h / 6.0 * b for a, b in zip(start, total, strict=True)]
    v = dyn.solve(k, e, inertia(end[:n]), end[n:])
    return [*dyn.public_coordinates(k, end[:n]), *dyn.public_coordinates(k, v)]


def tip(arm: FlexibleArm, state: Sequence[Any], sin: Function, cos: Function) -> list[Any]:
    """Return the tip of link 2 with deflection, x and y [m]; arguments as in `state_rate`."""
    k = arm.constants
    y = dyn.internal_coordinates(k, [state[i] for i in range(arm.size)])
    one, two = ((sin(angle), cos(angle)) for angle in (y[0], y[len(y) // 2]))
    return list(sensing.true_point(k, arm.place(2, arm.parameters.link_lengths[1]), y, one, two))
