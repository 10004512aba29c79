"""Plans for arms with other payloads and stiffnesses, made from a plan by its own feedback."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexarm_baselines.optimal import LinearQuadratic, Plan, RegulatorWeights
from flexarm_env.parameters import ArmParameters
from flexarm_env.simulation.arm import FlexibleArm

LONGEST = {"payload_mass": 0.25, "stiffness": 0.2}  # of one step towards another arm


def other_arm(parameters: ArmParameters, payload_mass: float, stiffness: float) -> ArmParameters:
    """Return an arm with more payload [kg], and its links' stiffness multiplied."""
    return replace(
        parameters,
        payload_mass=parameters.payload_mass + payload_mass,
        flexural_rigidities=tuple(stiffness * each for each in parameters.flexural_rigidities),
    )


def plan_for(plan: Plan, payload_mass: float, stiffness: float, weights: RegulatorWeights) -> Plan:
    """Make a plan for another arm along the same reference.

    Each step towards that arm is one of Gauss and Newton's: the regulator of the arm so far reckons with the change of
    payload and stiffness ahead, and drives the next arm.

    Args:
        plan: the plan.
        payload_mass: that the other arm has more [kg].
        stiffness: factor on the stiffness of both links.
        weights: of the regulator.
    """
    names, change = tuple(LONGEST), np.array([payload_mass, np.log(stiffness)])
    steps = max(int(np.ceil(np.max(np.abs(change) / list(LONGEST.values())) - 1e-9)), 0)
    found = plan
    for share in np.arange(1, steps + 1) / steps:
        problem = LinearQuadratic.along(found, weights, found.arm).with_quantities(names)
        size, gains = found.states.shape[1], problem.gains()
        arm = FlexibleArm(other_arm(plan.parameters, share * payload_mass, stiffness**share))
        ahead = [payload_mass / steps, stiffness ** (1.0 / steps) - 1.0]
        run = arm.rollout(
            found.states[0],
            found.torques + gains[:, :, size:] @ ahead,
            gains=np.ascontiguousarray(gains[:, :, :size]),
            references=found.states[:-1],
            limits=plan.limits,
            period=plan.period,
            step=plan.step,
        )
        found = replace(found, parameters=arm.parameters, states=run.states, torques=run.torques)
    return found
