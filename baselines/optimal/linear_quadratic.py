"""The linear-quadratic problem of deviations from a plan, and the gains that solve it.

Source: Anderson & Moore, *Optimal Control: Linear Quadratic Methods*, 1990, chapter 3; weights by Bryson's rule;
integral action by augmentation with the integral, chapter 10.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from flexarm_baselines.arrays import Floats, prolonged
from flexarm_baselines.optimal.kernels import Model
from flexarm_baselines.optimal.plan import Plan
from flexarm_baselines.optimal.sweep import sweep
from flexarm_env.physics.constants import ARM_QUANTITIES
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import number, pair

ENDURING = 2.0  # [s]; so long the last linearisation goes on beyond the plan's end, where gains would else vanish


@dataclass(frozen=True)
class RegulatorWeights:
    """Deviations that weigh alike: the regulator trades one against the other (Bryson's rule).

    Attributes:
        tip: of the tip from the plan's [m].
        speed: of the tip's velocity [m/s].
        torque: of shoulder and elbow from the plan's [N m].
    """

    tip: float = 0.01
    speed: float = 0.3
    torque: tuple[float, float] = (6.0, 2.0)

    def __post_init__(self) -> None:
        """Check the numbers."""
        number("tip", self.tip, "m", above=0.0)
        number("speed", self.speed, "m/s", above=0.0)
        object.__setattr__(self, "torque", pair("torque", self.torque, "N m", above=0.0))


GOOD = RegulatorWeights()
AGGRESSIVE = RegulatorWeights(speed=0.1, torque=(60.0, 20.0))


@dataclass(frozen=True)
class LinearQuadratic:
    """Deviations z from a plan over n control periods, and their cost: z' Q z, and torques' deviations over `torque`.

    Attributes:
        by_state: derivatives of the next z by z. Shape (n, d, d).
        by_torque: its derivatives by the torques. Shape (n, d, 2).
        by_quantity: its derivatives by quantities of the arm (`StepJacobians.by_quantity`). Shape (n, d, 3).
        cost: Q at each instant. Shape (n + 1, d, d).
        tip: derivatives of the tip by z. Shape (n + 1, 2, d).
        torque: deviations of the torques that cost 1 [N m].
        period: control period [s].
    """

    by_state: Floats
    by_torque: Floats
    by_quantity: Floats
    cost: Floats
    tip: Floats
    torque: tuple[float, float]
    period: float

    @classmethod
    def along(cls, plan: Plan, weights: RegulatorWeights, arm: FlexibleArm, **quantities: float) -> Self:
        """Linearise an arm along a plan; z is the deviation of its state.

        Args:
            plan: the plan.
            weights: of the cost.
            arm: the arm.
            **quantities: in the place of the arm's own, see `FlexibleArm.step`.
        """
        now = plan.carrying(quantities, arm)
        found = arm.step_jacobians(plan.states[:-1], plan.torques, plan.period, step=plan.step, **now)
        by_quantity = found.by_quantity.copy()
        by_quantity[..., list(ARM_QUANTITIES).index("payload_mass")] *= plan.own_payload[:, None]
        _, slopes = arm.output_jacobians(plan.states)
        outputs = slopes.sensed / np.array([weights.tip, weights.tip, weights.speed, weights.speed])[:, None]
        cost = outputs.swapaxes(1, 2) @ outputs
        tip = slopes.sensed[:, :2]
        return cls(found.by_state, found.by_torque, by_quantity, cost, tip, weights.torque, plan.period)

    def with_integral(self, integral: float) -> Self:
        """Add the integral of the tip's deviation to z.

        Args:
            integral: deviation of it that costs 1 [m s].
        """
        d = self.by_torque.shape[1]
        wider = self._wider(2)
        wider.by_state[:, d:, :d] = self.period * self.tip[:-1]
        wider.cost[:, d:, d:] = np.eye(2) / integral**2
        return wider

    def with_quantities(self, names: Sequence[str]) -> Self:
        """Add deviations of constant quantities of the arm to z, so that the regulator reckons with what they will do.

        Args:
            names: of `constants.ARM_QUANTITIES`.
        """
        d = self.by_torque.shape[1]
        wider = self._wider(len(names))
        wider.by_state[:, :d, d:] = self.by_quantity[..., [list(ARM_QUANTITIES).index(name) for name in names]]
        return wider

    def with_actuation_delay(self, share: float) -> Self:
        """Add the torques of the period before to z, which go on acting for a share of each period."""
        d = self.by_torque.shape[1]
        wider = self._wider(2)
        wider.by_state[:, :d, d:] = share * self.by_torque
        wider.by_state[:, d:, d:] = 0.0
        wider.by_torque[:, :d] *= 1.0 - share
        wider.by_torque[:, d:] = np.eye(2)
        return wider

    def _wider(self, more: int) -> Self:
        """Add numbers to z that stay as they are, and neither cost nor do anything yet."""

        def padded(table: Floats, *axes: int) -> Floats:
            return np.pad(table, [(0, more * (axis in axes)) for axis in range(table.ndim)])

        d = self.by_torque.shape[1]
        by_state, by_torque, cost = padded(self.by_state, 1, 2), padded(self.by_torque, 1), padded(self.cost, 1, 2)
        by_state[:, d:, d:] = np.eye(more)
        by_quantity, tip = padded(self.by_quantity, 1), padded(self.tip, 2)
        return replace(self, by_state=by_state, by_torque=by_torque, by_quantity=by_quantity, cost=cost, tip=tip)

    def gains(self) -> Floats:
        """Solve the Riccati recursion backward from the last linearisation's enduring regulator. Shape (n, 2, d)."""
        return self.improved(np.zeros(self.cost.shape[:2]))[1]

    def improved(self, gradient: Floats) -> tuple[Floats, Floats]:
        """Return changes of the torques, Shape (n, 2), and gains, as `gains` does, if z has a linear cost as well.

        Args:
            gradient: of the linear cost, which is added to half the quadratic one, at each instant. Shape (n + 1, d).
        """
        more, size = round(ENDURING / self.period), self.by_torque.shape[1]
        count = len(self.by_torque)
        model = Model(
            prolonged(self.by_state, more),
            prolonged(self.by_torque, more),
            np.concatenate([gradient, np.zeros((more, size))]),
            prolonged(self.cost, more),
            np.array([0.5 / np.square(self.torque), np.zeros(2)]),
            np.zeros((count + more + 1, 2)),
        )
        found = sweep(model)
        return found.forward[:count], np.ascontiguousarray(found.gains[:count, :, :size])
