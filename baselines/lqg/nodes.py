"""Plans for other payloads and stiffnesses, made from a plan by its own feedback."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal import LinearQuadratic, Plan, RegulatorWeights
from flexarm_env.simulation.arm import FlexibleArm

NAMES = ("payload_mass", "stiffness")
LONGEST = (0.25, 0.25)  # of a step towards another arm: [kg], [1]


class Node(NamedTuple):
    """A plan for one payload and stiffness.

    Attributes:
        values: payload [kg], and the factor on the stiffness of both links. Shape (2,).
        plan: the plan; its `parameters` are those of the arm that it began with.
        problem: deviations from it.
    """

    values: Floats
    plan: Plan
    problem: LinearQuadratic

    @classmethod
    def of(cls, values: Floats, plan: Plan, arm: FlexibleArm, weights: RegulatorWeights) -> Node:
        """Linearise the arm with these values along the plan."""
        return cls(values, plan, LinearQuadratic.along(plan, weights, arm, **named(values)))

    def towards(self, values: Floats, arm: FlexibleArm, weights: RegulatorWeights) -> Node:
        """Make the node of other values.

        Each step towards them is one of Gauss and Newton's: a regulator that knows the change ahead drives the arm so
        changed. What it does is a motion of that arm, and close to the best one.
        """
        count, size = int(np.ceil(np.max(np.abs(values - self.values) / LONGEST) - 1e-9)), 2 * arm.size
        node = self
        for next_values in np.linspace(self.values, values, count + 1)[1:]:
            gains, plan = node.problem.with_quantities(NAMES).gains(), node.plan
            run = arm.rollout(
                plan.states[0],
                plan.torques + gains[:, :, size:] @ (next_values - node.values),
                gains=np.ascontiguousarray(gains[:, :, :size]),
                references=plan.states[:-1],
                limits=plan.limits,
                period=plan.period,
                step=plan.step,
                **named(next_values),
            )
            node = Node.of(next_values, replace(plan, states=run.states, torques=run.torques), arm, weights)
        return node


def grid(
    plan: Plan, arm: FlexibleArm, payloads: Sequence[float], stiffnesses: Sequence[float], weights: RegulatorWeights
) -> list[Node]:
    """Make the nodes of a grid, from the plan for the arm's own payload and stiffness.

    Args:
        plan: the plan.
        arm: the arm.
        payloads: [kg].
        stiffnesses: factors on the stiffness of both links.
        weights: of the regulators.

    Returns:
        Nodes; the stiffness changes first.
    """
    own = Node.of(np.array([arm.parameters.payload_mass, 1.0]), plan, arm, weights)
    found = []
    row = [own.towards(np.array([own.values[0], stiffness]), arm, weights) for stiffness in stiffnesses]
    for payload in payloads:
        row = [node.towards(np.array([payload, node.values[1]]), arm, weights) for node in row]
        found += row
    return found


def named(values: Floats) -> dict[str, Any]:
    """Return a node's values as `FlexibleArm.step` takes them."""
    return dict(zip(NAMES, values.tolist(), strict=True))
