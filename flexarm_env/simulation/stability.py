"""How fast the arm and its inner law are: what the integrators' step must follow."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from flexarm_env.parameters import ArmParameters
from flexarm_env.physics.dynamics import joint_angles
from flexarm_env.physics.linearisation import straight_arms
from flexarm_env.simulation.arm import FlexibleArm

Gains = tuple[float, float]  # of shoulder and elbow
# Largest h |pole| that is allowed, by the integrator of an action mode (`actions.ActionMode`): RK4 is stable up to 2.78
# (real) and 2.83 (imaginary), the explicit part of ARS(4,4,3) up to 1.57; large vibrations need a margin.
STABLE_ANGLE = {"explicit": 2.0, "implicit": 1.2}
ELBOWS = np.linspace(0.0, np.pi, 7)  # [rad]

# The explicit part of ARS(4,4,3) is stable for undamped modes up to h omega = 1.57. The default step, a tenth of that
# and 0.25 ms at most, keeps coordinates within 1e-3 of their range over the lap at constant gains up to 17 (the paper's
# runs: 2e-4), and rates within 2e-3, largest just after a jump of the command (tests/simulation/test_law_accuracy.py).
# RK4's step is the longest whose expected error is small (`step_error`), within these two: beyond them motions that are
# not linear err by more than that.
DEFAULT_ANGLE = {"explicit": 1.8, "implicit": 0.15}
LONGEST_DEFAULT = {"explicit": 2e-3, "implicit": 2.5e-4}  # [s]
# Limits of a control period of one arm. The longest period must not block the caller for long; a reading takes 32
# bytes, so that the longest delay line takes 64 MB.
MOST_STEPS = 20_000
MOST_READINGS = 2_000_000


class Integration(NamedTuple):
    """How the arm is integrated.

    Attributes:
        method: name of the method.
        order: its order.
        step: integration step [s].
        substeps: steps in a control period.
        expected_error: of the tip after a second of full random torques (`step_error`) [m]; None under the
            paper's law, whose error the default step bounds (`DEFAULT_ANGLE`).
    """

    method: str
    order: int
    step: float
    substeps: int
    expected_error: float | None


def extreme_arms(settings: Any) -> list[ArmParameters]:
    """Return the stiffest, lightest and most damped arm that an episode may draw, near rest and as its joints slide.

    Near rest dry friction is viscous. The torque-speed line is a slope of the torque as well, where it limits; twice
    that slope, since the torque has a corner where the line begins (tests/episode/test_motors.py).

    Args:
        settings: `Settings`.
    """
    own = settings.flexible_arm.parameters
    stiffness, payload = settings.range_of("stiffness")[1], settings.range_of("payload_mass")[0]
    damping = settings.range_of("damping")[1]
    rigidities = (own.flexural_rigidities[0] * stiffness, own.flexural_rigidities[1] * stiffness)
    extreme = replace(own, flexural_rigidities=rigidities, payload_mass=payload, damping_ratio=damping)
    arms = [extreme]
    if any(own.breakaway):
        arms.append(replace(extreme, coulomb_friction=(0.0, 0.0), breakaway_excess=(0.0, 0.0)))
    if settings.torque_speed_limit is not None:
        lines = zip(own.joint_friction, settings.motor_limit, settings.torque_speed_limit, strict=True)
        shoulder, elbow = (friction + 2.0 * stall / speed for friction, stall, speed in lines)
        arms.append(replace(extreme, joint_friction=(shoulder, elbow)))
    return arms


def fastest_rates(settings: Any) -> tuple[float, ...]:
    """Return the rates of the fastest arms that an episode may draw (`extreme_arms`), or of its inner loop [rad/s].

    Args:
        settings: `Settings`.
    """
    gains = (settings.inner_stiffness, settings.inner_damping) if settings.mode.law == "joints" else None
    return tuple(rate for arm in extreme_arms(settings) for rate in _rates_of(arm, gains))


@lru_cache(maxsize=256)
def _rates_of(parameters: ArmParameters, gains: tuple[Gains, Gains] | None) -> tuple[float, ...]:
    """Return the rates of an arm's fastest mode and, with gains, of its fastest pole under that inner law [rad/s]."""
    arm = FlexibleArm(parameters)
    if gains is None:
        return (arm.fastest_rate(),)
    by_state, by_torque = straight_arms(arm.constants, ELBOWS)
    joints = np.array(joint_angles(arm.constants, list(np.eye(arm.size))))  # by internal coordinates
    stiffness, resistance = (np.array(gain)[:, None] * joints for gain in gains)
    poles = np.linalg.eigvals(by_state - by_torque @ np.concatenate([stiffness, resistance], axis=1))
    return arm.fastest_rate(), float(np.abs(poles).max())


def count_substeps(
    period: float,
    step: float | None,
    integrator: str,
    fastest: float,
    arm: str,
    what: str = "fastest mode",
) -> int:
    """Count the integration steps in a control period.

    Args:
        period: the control period [s].
        step: longest integration step as the user gives it [s]; None: as the arm demands.
        integrator: "explicit" or "implicit".
        fastest: rate of the arm's fastest mode or pole [rad/s].
        arm: description of the arm, for messages.
        what: whose rate it is, for messages.

    Raises:
        ValueError: for a step that is not stable, or more than `MOST_STEPS`.
    """
    if step is None:
        wanted = min(LONGEST_DEFAULT[integrator], DEFAULT_ANGLE[integrator] / fastest)
        cause = f"{arm}: its {what}, {fastest:.4g} rad/s, asks for steps of {wanted:.4g} s"
        return _count_steps(period, wanted, cause)
    longest = STABLE_ANGLE[integrator] / fastest
    if step > longest:
        raise ValueError(
            f"physics_step = {step} s: too long for the arm's {what}, {fastest:.4g} rad/s; "
            f"at most {longest:.4g} s is allowed"
        )
    return _count_steps(period, step, f"physics_step = {step} s")


def _count_steps(period: float, step: float, cause: str) -> int:
    count = period / step - 1e-9
    if not count <= MOST_STEPS:
        raise ValueError(
            f"{cause}: {count:.4g} integration steps in control_period = {period} s; at most {MOST_STEPS} are allowed"
        )
    return int(np.ceil(count))


def count_readings(count: float, step: float, cause: str) -> int:
    """Count the readings that a delay line holds for one arm.

    Args:
        count: how many are wanted.
        step: time between two [s].
        cause: cause of the count, for the message.

    Raises:
        ValueError: for more than `MOST_READINGS`.
    """
    if not count <= MOST_READINGS:
        raise ValueError(
            f"{cause}: {count:.4g} readings to keep, one for each integration step of {step:.4g} s; "
            f"at most {MOST_READINGS} are allowed"
        )
    return int(count)
