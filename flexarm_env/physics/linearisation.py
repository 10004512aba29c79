"""First-order expansion of a state's rate: the equations evaluated on dual numbers, exact to rounding error."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.tangents import Dual, tangents, value
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.coordinates import stack_matrix, to_internal, to_public
from flexarm_env.physics.modal_elimination import Elimination

Array = NDArray[np.float64]


class Linearisation(NamedTuple):
    """``d(state)/dt = A (state - state0) + B (torque - torque0) + rate`` about the point (state0, torque0).

    The state is ``(q, q')`` with q the joint angles [rad] and the modal coordinates, whose unit makes mode shape times
    coordinate a deflection [m]; [q] stands for the unit of each, n = 2 + 2 m for their number.

    Attributes:
        A: blocks of (n, n): upper 0 and 1; lower left [q_i/s^2 per q_j], stiffness over mass with its sign, lower right
            [q_i/s^2 per q_j/s], damping over mass. Its eigenvalues are in rad/s. Shape (2 n, 2 n).
        B: upper block 0; lower [q_i/s^2 per N m]. Shape (2 n, 2).
        rate: d(state)/dt at the operating point: [q_i/s], then [q_i/s^2]; zero at an equilibrium. Shape (2 n,).
    """

    A: Array
    B: Array
    rate: Array


def straight_arms(k: Constants, theta2: Array) -> tuple[Array, Array]:
    """Linearise the straight arm at rest, where no velocity force acts, at many angles of its elbow.

    Args:
        k: constants.
        theta2: [rad]. Shape (count,).

    Returns:
        A and B of `Linearisation`, each of internal coordinates. Shapes (count, 2 n, 2 n), (count, 2 n, 2).
    """
    k, n = k.at_rest, 2 * len(k.elbow_slopes) + 2
    zeros = np.zeros((n, 2 * n + 2))
    ways = np.eye(2 * n + 2)
    forces = dyn.applied_forces(k, list(ways[:n]), list(ways[n : 2 * n]), list(zeros), list(ways[2 * n :]))
    y = [np.zeros_like(theta2) for _ in range(n)]
    mass = stack_matrix(dyn.mass_matrix(k, y, np.cos(theta2), np.sin(theta2)))
    rates = np.zeros((len(theta2), 2 * n, 2 * n + 2))
    rates[:, :n, n : 2 * n] = np.eye(n)
    rates[:, n:] = np.linalg.solve(mass, np.broadcast_to(np.array(forces), (len(theta2), n, 2 * n + 2)))
    return rates[..., : 2 * n], rates[..., 2 * n :]


def linearise(k: Constants, e: Elimination | None, complete: bool, state: Array, torque: Array) -> Linearisation:
    """Linearise the torque-driven arm at a public state, Shape (2 n,), and a torque [N m], Shape (2,).

    `e` and `complete` are as of `dynamics.acceleration`.
    """
    n, inward, outward = len(state) // 2, to_internal(k), to_public(k)
    ways = np.zeros((2 * n + 2, 2 * n + 2))  # each internal coordinate, rate and torque by each public one
    ways[:n, :n] = ways[n : 2 * n, n : 2 * n] = inward
    ways[2 * n :, 2 * n :] = np.eye(2)
    point = [
        Dual(x, {None: way}) for x, way in zip((*inward @ state[:n], *inward @ state[n:], *torque), ways, strict=True)
    ]
    rates, slopes = _acceleration(k, e, complete, point[:n], point[n : 2 * n], point[2 * n :])
    jacobian = np.zeros((2 * n, 2 * n + 2))
    jacobian[:n, n : 2 * n] = np.eye(n)
    jacobian[n:] = outward @ slopes
    return Linearisation(jacobian[:, : 2 * n], jacobian[:, 2 * n :], np.concatenate([state[n:], outward @ rates]))


def _acceleration(
    k: Constants, e: Elimination | None, complete: bool, y: list[Dual], v: list[Dual], tau: list[Dual]
) -> tuple[Array, Array]:
    """v', and its tangents by the rule of implicit functions: M dv' = d(imbalance). Shapes (n,), (n, directions)."""
    sin, cos = _sincos(dyn.elbow_turn(y))
    angles = (cos, sin, _sincos(dyn.joint_angles(k, y)[1])[0])
    at_y, at_v, at_tau = ([value(x) for x in part] for part in (y, v, tau))
    at = value(cos), value(sin), value(angles[2])
    rates = dyn.acceleration(k, e, complete, at_y, at_v, at_tau, at)
    off = dyn.imbalance(k, complete, y, v, rates, tau, angles)
    inertia = dyn.inertia(k, e, at_y, *at[:2])
    return np.array(rates), np.array(dyn.solve(k, e, inertia, [tangents(force)[None] for force in off]))


def _sincos(angle: Dual) -> tuple[Any, Any]:
    """Return sine and cosine of any angle; the kernels' (`codegen.elementary.sincos`) exceed 1 beyond 1e15 rad."""
    at = value(angle)
    turn, sin, cos = angle - at, np.sin(at), np.cos(at)  # turn: zero, with the angle's tangents
    return sin + turn * cos, cos - turn * sin
