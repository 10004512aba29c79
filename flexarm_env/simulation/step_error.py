"""How wrong an integration step is: the tip's expected error under random torques, from the linearised arm.

The straight arm at rest, at some angles of its elbow, is driven by torques that are drawn uniformly within the motors'
limits every `HELD` seconds. The tip's response to each of them has the relative error that the Runge-Kutta method's
transition matrix makes in that time; errors of independent torques add up by their squares. What the linear arm lacks,
large turns, makes errors grow: the median over motions is `GROWTH` times that of the linear arm, as measured
(tests/simulation/test_step_error.py).

Where a joint with dry friction turns back, the momentum errs by friction times step, less where the step is short
beside the time constant of the joint near rest. The tip then errs by `DRY` times that over the rigid arm's inertia
about the joint times its lever, in a second; `DRY` as measured, too.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from flexarm_env.parameters import ArmParameters
from flexarm_env.physics import coordinates
from flexarm_env.physics.linearisation import straight_arms
from flexarm_env.simulation.arm import FlexibleArm

Array = NDArray[np.float64]
SECONDS, HELD = 1.0, 0.05  # of the motion, and of each torque [s]
ELBOWS = np.array([0.4, 1.6, 2.8])  # [rad]
# Links with linear kinematics do not stiffen as they turn: fast turns make them soft, and errors grow.
GROWTH = {"foreshortened": 3.0, "linear": 40.0}
DRY = 0.6  # [s]
TOLERANCE = 1e-4  # expected error that the default step keeps [m]
BENT = 0.25  # largest deflection of a link's tip that torques are taken to cause, as a share of its length
FINE = 32  # steps in one for the exact transition matrix: the method's error falls by a factor of a million


def enough_steps(parameters: ArmParameters, limits: tuple[float, float], period: float, least: int) -> int:
    """Return how many steps a control period needs so that the expected error keeps `TOLERANCE`.

    Args:
        parameters: see `expected_error`.
        limits: see `expected_error`.
        period: the control period [s].
        least: steps that stability demands.
    """
    count = least
    while (error := expected_error(parameters, limits, period / count)) > TOLERANCE:
        # the error falls with the fourth power of the step, more slowly as long as fast modes are not resolved
        count = max(count + 1, int(0.95 * count * (error / TOLERANCE) ** 0.25))
    return count


@lru_cache(maxsize=1024)
def expected_error(parameters: ArmParameters, limits: tuple[float, float], step: float) -> float:
    """Return the expected error of the tip after a second of random torques [m].

    Args:
        parameters: of the arm.
        limits: largest torques of shoulder and elbow [N m]; torques that bend the links further than `BENT` are scaled.
        step: of the Runge-Kutta method [s].
    """
    rates, outputs = _linear_arms(parameters)
    steps = max(1, round(HELD / step))
    exact, found = (
        _responses(np.linalg.matrix_power(_one_step(rates * HELD / count), count), outputs) * (limits / np.sqrt(3.0))
        for count in (FINE * steps, steps)
    )
    bends = np.sqrt(np.sum(np.square(exact[:, :, 2:]), axis=(1, 3)))  # of each link's tip
    share = np.min(BENT * np.array(parameters.link_lengths) / np.maximum(bends, 1e-300), axis=1)
    squares = np.minimum(share, 1.0) ** 2 * np.sum(np.square((found - exact)[:, :, :2]), axis=(1, 2, 3))
    linear = GROWTH[parameters.kinematics] * float(np.sqrt(np.mean(squares)))
    return float(np.hypot(linear, DRY * step * _dry_rate(parameters, step))) if any(parameters.breakaway) else linear


def _dry_rate(parameters: ArmParameters, step: float) -> float:
    """Return what a step misses of the acceleration of the straight rigid arm's tip by dry friction [m/s^2]."""
    mass = FlexibleArm(parameters).mass_matrix(np.zeros(2 * parameters.modes_per_link + 2))
    levers = np.array([parameters.reach, parameters.link_lengths[1]])
    friction, inertia = np.array(parameters.breakaway), np.diagonal(mass)[:2]
    rates = friction / parameters.friction_smoothing * np.diagonal(np.linalg.inv(mass))[:2]  # near rest [1/s]
    return float(np.linalg.norm(levers * friction / inertia * np.minimum(step * rates, 1.0)))


def _one_step(scaled: Array) -> Array:
    """Return the transition matrix of a step of the Runge-Kutta method, from rates times the step."""
    one = np.eye(scaled.shape[-1])
    return one + scaled @ (one + scaled @ (one + scaled @ (one + scaled / 4.0) / 3.0) / 2.0)


def _responses(transition: Array, outputs: Array) -> Array:
    """Return outputs at the end by each held torque. Shape (elbows, torques, outputs, 2)."""
    n = outputs.shape[-1]
    reached, found = transition[:, :n, n:], []
    for _ in range(round(SECONDS / HELD)):
        found.append(outputs @ reached)
        reached = transition[:, :n, :n] @ reached
    return np.stack(found, axis=1)


@lru_cache(maxsize=256)
def _linear_arms(parameters: ArmParameters) -> tuple[Array, Array]:
    """Return rates of (state, torque), and derivatives of tip and deflections by the state, at each of `ELBOWS`."""
    arm = FlexibleArm(parameters)
    k, n, m = arm.constants, arm.size, parameters.modes_per_link
    rates = np.zeros((len(ELBOWS), 2 * n + 2, 2 * n + 2))
    rates[:, : 2 * n] = np.concatenate(straight_arms(k, ELBOWS), axis=2)
    y = np.zeros((len(ELBOWS), n))
    y[:, m + 1] = ELBOWS
    outputs = np.zeros((len(ELBOWS), 4, 2 * n))
    end = np.asarray(parameters.link_lengths[1])
    _, outputs[:, :2, :n] = coordinates.material_point(arm.modes, k.foreshortened, y, 2, end)
    outputs[:, 2, 1 : m + 1], outputs[:, 3, m + 2 : n] = (link.tip_values for link in arm.modes)
    return rates, outputs
