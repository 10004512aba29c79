"""How fast the arm and its inner law are: what the integrators' step must follow."""

from __future__ import annotations

import numpy as np

from flexarm_env.simulation.arm import FlexibleArm

# Longest h |pole| that is allowed: RK4 is stable up to 2.78 (real) and 2.83 (imaginary), the explicit part of
# ARS(4,4,3) up to 1.57; large vibrations need a margin.
STABLE_ANGLE = {"torque": 2.0, "residual": 2.0, "reference": 2.0, "gain": 1.2}
ELBOWS = np.linspace(0.0, np.pi, 7)  # [rad]

# The explicit part of ARS(4,4,3) is stable for undamped modes up to h omega = 1.57. The default step, a tenth of that
# and 0.25 ms at most, keeps coordinates within 1e-3 of their range over the lap at constant gains up to 17 (the paper's
# runs: 2e-4), and rates within 2e-3, largest just after a jump of the command (tests/test_closed_loop.py).
STEP_LIMIT = 1.2
DEFAULT_ANGLE = 0.15
DEFAULT_STEP = 2.5e-4


def fastest_pole(
    arm: FlexibleArm, theta2: float, stiffness: tuple[float, float], resistance: tuple[float, float]
) -> float:
    """Largest magnitude of a pole of the arm under the inner law, at rest with the elbow at an angle [rad/s]."""
    state = np.zeros(2 * arm.size)
    state[1] = theta2
    linear = arm.linearise(state)
    feedback = np.zeros((2, 2 * arm.size))
    feedback[[0, 1], [0, 1]] = stiffness
    feedback[[0, 1], [arm.size, arm.size + 1]] = resistance
    return float(np.abs(np.linalg.eigvals(linear.A - linear.B @ feedback)).max())


def default_step(fastest: float) -> float:
    """Integration step [s] for an arm whose fastest mode has this rate [rad/s]."""
    return min(DEFAULT_STEP, DEFAULT_ANGLE / fastest)
