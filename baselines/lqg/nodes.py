"""Plans for other payloads and stiffnesses, made from a plan by its own feedback."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal import LinearQuadratic, Plan, RegulatorWeights
from flexarm_baselines.optimal.phases import plan_phases
from flexarm_env.parameters import ArmParameters
from flexarm_env.simulation.arm import FlexibleArm

NAMES = ("payload_mass", "stiffness")
LONGEST = (0.25, 0.25)  # of a step towards another arm: [kg], [1]
BEND = 0.9  # [m]; of a link's tip off its root tangent; an episode ends at 1.5
EXCESS = 0.05  # [m]; deflection beyond `BEND` that weighs as much as the deviations of `RegulatorWeights` do
EASINGS = 4  # most steps of `Node.eased`


class Node(NamedTuple):
    """A plan for one payload and stiffness.

    Attributes:
        values: payload [kg], and the factor on the stiffness of both links. Shape (2,).
        plan: the plan; its `parameters` are those of the arm that it began with.
        problem: linear-quadratic problem of the deviations from it.
    """

    values: Floats
    plan: Plan
    problem: LinearQuadratic

    @classmethod
    def of(cls, values: Floats, plan: Plan, arm: FlexibleArm, weights: RegulatorWeights) -> Node:
        """Linearise the arm with these values along the plan; where links bend far, their bending costs, too."""
        problem = LinearQuadratic.along(plan, weights, arm, **named(values))
        bend, by_state = _bending(plan, arm)
        far = (np.abs(bend) > BEND) / EXCESS**2
        costly = np.einsum("tl,li,lj->tij", far, by_state, by_state)
        return cls(values, plan, replace(problem, cost=problem.cost + costly))

    def towards(self, values: Floats, arm: FlexibleArm, weights: RegulatorWeights) -> Node:
        """Make the node of other values.

        Each step towards them is one of Gauss and Newton's: a regulator that is given the change drives the changed
        arm. The result is a motion of that arm, and close to its best one.
        """
        count = int(np.ceil(np.max(np.abs(values - self.values) / LONGEST) - 1e-9))
        node = self
        for next_values in np.linspace(self.values, values, count + 1)[1:]:
            gains, size = node.problem.with_quantities(NAMES).gains(), 2 * arm.size
            forward = gains[:, :, size:] @ (next_values - node.values)
            node = node._moved(next_values, forward, gains[:, :, :size], arm, weights)
        return node

    def eased(self, arm: FlexibleArm, weights: RegulatorWeights) -> Node:
        """Make the node whose plan bends the links by little more than `BEND`, in steps of Gauss and Newton."""
        node = self
        for _ in range(EASINGS):
            bend, by_state = _bending(node.plan, arm)
            excess = np.sign(bend) * np.maximum(np.abs(bend) - BEND, 0.0)
            if not excess.any():
                break
            node = node._moved(node.values, *node.problem.improved(excess @ by_state / EXCESS**2), arm, weights)
        return node

    def _moved(
        self, values: Floats, forward: Floats, gains: Floats, arm: FlexibleArm, weights: RegulatorWeights
    ) -> Node:
        """Make the node of what an arm does along the plan, under changed torques and gains on deviations."""
        plan = self.plan
        feedback = {"gains": np.ascontiguousarray(gains), "references": plan.states[:-1]}
        run = plan.rollout(arm, plan.states[0], plan.torques + forward, **feedback, **named(values))
        return Node.of(values, replace(plan, states=run.states, torques=run.torques), arm, weights)


def _bending(plan: Plan, arm: FlexibleArm) -> tuple[Floats, Floats]:
    """Return deflections of both links' tips [m], Shape (n + 1, 2), and their derivatives, Shape (2, 4 + 4 m)."""
    by_state, modes = np.zeros((2, plan.states.shape[1])), arm.parameters.modes_per_link
    for link, modal in enumerate(arm.modes):
        by_state[link, 2 + link * modes : 2 + (link + 1) * modes] = modal.tip_values
    return plan.states @ by_state.T, by_state


def grid(
    plan: Plan, arm: FlexibleArm, payloads: Sequence[float], stiffnesses: Sequence[float], weights: RegulatorWeights
) -> list[Node]:
    """Make the nodes of a grid, from the plan for the arm's own payload and stiffness.

    Plans of other values are eased (`Node.eased`): a controller on them is still estimating the arm, and bends it more.

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
    if plan.payloads is not None:  # steps towards less than half of a payload diverge
        side = "negative" if plan.states[0, 1] < 0.0 else "positive"
        for payload in payloads:
            made = replace(plan.parameters, payload_mass=payload)
            anew = plan_phases(made, plan.reference, plan.payloads, side, plan.period, plan.limits)
            first = Node.of(np.array([payload, 1.0]), anew, arm, weights)
            found += [first.towards(np.array([payload, factor]), arm, weights) for factor in stiffnesses]
        return found
    row = [own.towards(np.array([own.values[0], stiffness]), arm, weights) for stiffness in stiffnesses]
    for payload in payloads:
        row = [node.towards(np.array([payload, node.values[1]]), arm, weights) for node in row]
        found += [node if node.plan is plan else node.eased(arm, weights) for node in row]
    return found


def named(values: Floats) -> dict[str, Any]:
    """Return a node's values as `FlexibleArm.step` takes them."""
    return dict(zip(NAMES, values.tolist(), strict=True))


class PlanNumbers(NamedTuple):
    """What a plan holds, but for its notes, as values that can be compared and hashed."""

    parameters: ArmParameters
    states: bytes
    torques: bytes
    reference: bytes
    limits: tuple[float, float]
    period: float
    step: float
    payloads: bytes | None

    @classmethod
    def of(cls, plan: Plan) -> PlanNumbers:
        """Take them from a plan."""
        arrays = plan.states.tobytes(), plan.torques.tobytes(), plan.reference.tobytes()
        payloads = None if plan.payloads is None else np.asarray(plan.payloads, dtype=np.float64).tobytes()
        return cls(plan.parameters, *arrays, plan.limits, plan.period, plan.step, payloads)

    def plan(self) -> Plan:
        """Make the plan again."""
        torques, reference = (np.frombuffer(one).reshape(-1, 2) for one in (self.torques, self.reference))
        arrays = np.frombuffer(self.states).reshape(len(reference), -1), torques, reference
        payloads = None if self.payloads is None else np.frombuffer(self.payloads)
        return Plan(self.parameters, *arrays, self.limits, self.period, self.step, payloads=payloads)
