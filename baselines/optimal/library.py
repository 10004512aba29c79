"""The plans that come with the package, found by the task that they are for, turned or mirrored where that does."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal.plan import Plan, load_plan, plan_names, plan_task
from flexarm_env.parameters import ArmParameters

SAME = 1e-6  # [m]; references that are nowhere farther apart are the same
SAME_PERIOD = 1e-12  # [s]; likewise of control periods


def turned(plan: Plan, angle: float) -> Plan:
    """Turn a plan about the shoulder by an angle [rad]; without gravity the same torques do it."""
    states = plan.states.copy()
    states[:, 0] += angle
    cos, sin = np.cos(angle), np.sin(angle)
    return replace(plan, states=states, reference=plan.reference @ np.array([[cos, sin], [-sin, cos]]))


def mirrored(plan: Plan, axis: float = 0.0) -> Plan:
    """Reflect a plan about a line through the shoulder, at the angle `axis` from the world's x axis [rad]."""
    states = -plan.states
    states[:, 0] += 2.0 * axis
    cos, sin = np.cos(2.0 * axis), np.sin(2.0 * axis)
    reference = plan.reference @ np.array([[cos, sin], [sin, -cos]])
    return replace(plan, states=states, torques=-plan.torques, reference=reference)


def plans_for(
    arm: ArmParameters, reference: Floats, period: float, limits: tuple[float, float]
) -> tuple[tuple[str, Plan], ...]:
    """Find the package's plans for a reference, with their names.

    Args:
        arm: the arm; a plan for another one is none for this.
        reference: where the tip should be at each instant of the lap [m]. Shape (n + 1, 2).
        period: control period [s].
        limits: largest torques of shoulder and elbow [N m].

    Returns:
        Plans along that very reference, one for each that is shipped for it or for its image; empty if there is none.
    """
    found = []
    for name in plan_names():
        parameters, own_limits, own_period, way = _task_of(name)
        fits = parameters == arm and abs(own_period - period) <= SAME_PERIOD and np.allclose(own_limits, limits)
        moved = moved_onto(_loaded(name), reference) if fits and way.shape == reference.shape else None
        if moved is not None:
            found.append((name, moved))
    return tuple(found)


def moved_onto(plan: Plan, reference: Floats) -> Plan | None:
    """Turn or reflect a plan so that its reference is the given one; None if no such motion does it."""
    own, other = (float(np.arctan2(*points[0][::-1])) for points in (plan.reference, reference))
    for moved in (turned(plan, other - own), mirrored(plan, 0.5 * (own + other))):
        if np.abs(moved.reference - reference).max() < SAME:
            return moved
    return None


_loaded, _task_of = cache(load_plan), cache(plan_task)
