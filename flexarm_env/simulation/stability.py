"""How fast the arm and its inner law are: what the integrators' step must follow."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from flexarm_env.simulation.arm import FlexibleArm

# Longest h |pole| that is allowed: RK4 is stable up to 2.78 (real) and 2.83 (imaginary), the explicit part of
# ARS(4,4,3) up to 1.57; large vibrations need a margin.
STABLE_ANGLE = {"torque": 2.0, "residual": 2.0, "reference": 2.0, "gain": 1.2}
ELBOWS = np.linspace(0.0, np.pi, 7)  # [rad]


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


def fastest_rates(settings: Any) -> list[float]:
    """Of the stiffest and lightest arm that an episode may draw; under the inner law, of the closed loop [rad/s].

    Args:
        settings: `Settings`.
    """
    own = settings.flexible_arm.parameters
    stiffness = settings.randomisation.get("stiffness", (1.0, 1.0))[1]
    payload = settings.randomisation.get("payload_mass", (own.payload_mass, own.payload_mass))[0]
    damping = settings.randomisation.get("damping", (0.0, own.modal_damping_ratio))[1]
    rigidities = (own.flexural_rigidities[0] * stiffness, own.flexural_rigidities[1] * stiffness)
    arm = FlexibleArm(replace(own, flexural_rigidities=rigidities, payload_mass=payload, modal_damping_ratio=damping))
    rates = [arm.fastest_rate()]
    if settings.action_mode in ("residual", "reference"):
        rates += [fastest_pole(arm, theta2, settings.inner_stiffness, settings.inner_resistance) for theta2 in ELBOWS]
    return rates
