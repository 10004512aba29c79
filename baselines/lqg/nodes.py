"""Plans for other payloads and stiffnesses, made from a plan by its own feedback."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexarm_baselines.optimal import GOOD, LinearQuadratic, Plan
from flexarm_env.simulation.arm import FlexibleArm

NAMES = ("payload_mass", "stiffness")
LONGEST = (0.25, 0.25)  # of a step towards another arm: [kg], [1]


def plan_for(plan: Plan, arm: FlexibleArm, payload_mass: float, stiffness: float) -> Plan:
    """Make a plan for another payload and stiffness along the same reference.

    Each step towards them is one of Gauss and Newton's: a regulator that knows the change ahead drives the arm so
    changed. What it does is a motion of that arm, and close to the best one.

    Args:
        plan: for the arm's own payload and stiffness.
        arm: the arm.
        payload_mass: [kg].
        stiffness: factor on the stiffness of both links.

    Returns:
        The plan; its `parameters` are those of the other arm.
    """
    own = arm.parameters
    begin, end = np.array([own.payload_mass, 1.0]), np.array([payload_mass, stiffness])
    count, size = int(np.ceil(np.max(np.abs(end - begin) / LONGEST))), plan.states.shape[1]
    found, before = plan, begin
    for values in np.linspace(begin, end, count + 1)[1:]:
        gains = LinearQuadratic.along(found, GOOD, arm, **_named(before)).with_quantities(NAMES).gains()
        run = arm.rollout(
            found.states[0],
            found.torques + gains[:, :, size:] @ (values - before),
            gains=np.ascontiguousarray(gains[:, :, :size]),
            references=found.states[:-1],
            limits=plan.limits,
            period=plan.period,
            step=plan.step,
            **_named(values),
        )
        found, before = replace(found, states=run.states, torques=run.torques), values
    first, second = (stiffness * each for each in own.flexural_rigidities)
    return replace(found, parameters=replace(own, payload_mass=payload_mass, flexural_rigidities=(first, second)))


def _named(values: np.ndarray) -> dict[str, float]:
    return dict(zip(NAMES, values.tolist(), strict=True))
