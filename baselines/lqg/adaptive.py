"""`AdaptiveLQG`: LQG that finds out payload, stiffness, damping, and how late the sensor and the motors are.

Sources: Ljung, IEEE Trans. Automatic Control 24, 1979 (joint estimation of state and parameters); Friedland, IEEE
Trans. Automatic Control 14, 1969 (a filter for the state and one for a constant beside it: how late the motors are);
Rugh and Shamma, *Research on gain scheduling*, Automatica 36, 2000.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from flexarm_baselines.along_plans import PlanController
from flexarm_baselines.arrays import Array, Floats
from flexarm_baselines.controller import Memory, Seen
from flexarm_baselines.lqg.controller import LQG
from flexarm_baselines.lqg.nodes import grid, named
from flexarm_baselines.lqg.tables import FilterTables, Place, RegulatorTables, joined, product
from flexarm_baselines.observers import KalmanFilter, NoiseModel
from flexarm_baselines.optimal import GOOD, Plan, RegulatorWeights
from flexarm_baselines.task import Task
from flexarm_env.simulation.arm import FlexibleArm

# Encoders count for little, their rates for hardly anything: fast vibrations, which no model has right, would else
# pass for payload at the first moves.
NOISE = NoiseModel(joint_angle=3e-3, joint_rate=3.0, tip=0.01, torque=(5.0, 2.0), modal_force=3e-4)


class Unknown(NamedTuple):
    """What is thought of a quantity before an episode.

    Attributes:
        mean: expected value; None: that of the task.
        deviation: standard deviation.
        drift: how far it may wander in a second, as a share of that.
        least: estimates stay above.
        most: estimates stay below.
    """

    mean: float | None
    deviation: float
    drift: float
    least: float
    most: float


QUANTITIES = {
    "payload_mass": Unknown(0.3, 0.4, 0.2, 0.0, 1.1),  # [kg]
    "stiffness": Unknown(0.9, 0.15, 0.1, 0.75, 1.35),
    "damping": Unknown(None, 0.003, 0.1, 0.001, 0.03),
    "delay": Unknown(None, 0.02, 0.1, 0.0, 0.08),  # [s]
}
LATENESS = Unknown(4e-3, 3e-3, 0.03, 0.0, 0.01)  # of the motors [s]
OF_THE_ARM = ("payload_mass", "stiffness", "damping")
PAYLOADS = (0.0, 0.25, 0.5, 0.75, 1.0)  # [kg]
STIFFNESSES = (0.8, 1.0, 1.25)


class AdaptiveLQG(LQG):
    """LQG for an arm, a sensor and motors that differ from what is published.

    It has plans, filters and regulators for a grid of payloads and stiffnesses. The filter estimates these with the
    state, with damping and the sensor's delay; each arm goes by the tables nearest to its own estimates, which
    reckon with what is left to first order. A second filter estimates how late the motors are.

    Attributes:
        filter: tables of all nodes of the grid, for each of these those of all plans.
        regulator: likewise.
    """

    def __init__(
        self,
        task: Task,
        plans: Sequence[Plan] | None = None,
        weights: RegulatorWeights = GOOD,
        noise: NoiseModel = NOISE,
        payloads: Sequence[float] = PAYLOADS,
        stiffnesses: Sequence[float] = STIFFNESSES,
        late: float = 3e-3,
    ) -> None:
        """Make plans, filters and regulators for all nodes.

        Args:
            task: see `Task`.
            plans: see `PlanController`.
            weights: of the regulators.
            noise: standard deviations that the filters assume.
            payloads: payloads of the grid [kg].
            stiffnesses: factors on the links' stiffness of the grid.
            late: how late the regulators take the motors to be [s].
        """
        PlanController.__init__(self, task, plans)
        arm = FlexibleArm(task.arm)
        kalman = KalmanFilter(
            arm,
            task.period,
            task.delay,
            task.sensor_position,
            noise,
            {name: one.deviation for name, one in QUANTITIES.items()},
            {name: one.drift for name, one in QUANTITIES.items()},
        )
        filters, regulators = [], []
        self._grid = sorted(payloads), sorted(stiffnesses)
        for nodes in zip(*(grid(plan, arm, *self._grid, weights) for plan in self.plans), strict=True):
            node_plans = [node.plan for node in nodes]
            problems = [node.problem.with_quantities(OF_THE_ARM) for node in nodes]
            filters.append(FilterTables.along(kalman, node_plans, **named(nodes[0].values)))
            regulators.append(RegulatorTables.along(node_plans, problems, late / task.period))
        self.filter, self.regulator = joined(filters), joined(regulators)
        size = 2 * arm.size
        self._quantities = slice(size, size + len(QUANTITIES))
        self._of_the_arm = size + len(OF_THE_ARM)
        self._least, self._most = np.array([(one.least, one.most) for one in QUANTITIES.values()]).T

    def start(self, seen: Seen) -> Memory:
        """Begin on the nearest plan, with what is thought of the quantities before an episode."""
        count, period = len(seen), self.period_of(seen)
        chosen = self.nearest(seen["joint_angles"], period)
        estimate = self.filter.nominal[chosen, period].astype(np.float64)
        for column, one in enumerate(QUANTITIES.values(), self._quantities.start):
            if one.mean is not None:
                estimate[:, column] = one.mean
        late = np.full(count, LATENESS.mean), np.full(count, LATENESS.deviation**2)
        return estimate, chosen, np.zeros((count, 2)), *late, np.zeros_like(estimate)

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        """Correct the estimates by the readings, command torques, and predict the next estimates."""
        estimate, chosen, before, late, variance, slope = memory
        period, tables = self.period_of(seen), self.filter
        at = self._nearest_node(chosen, estimate), period
        residual = tables.residual(estimate, self._readings(seen))
        seen_slope = slope[:, tables.rows]
        change, variance = self._later(at, residual, seen_slope, late, variance)
        late = late + change
        gain, scaled = tables.gain[at], change[:, None] / self.task.period
        estimate = estimate + scaled * slope + product(gain, residual - scaled * seen_slope)
        slope = slope - product(gain, seen_slope)
        estimate[:, self._quantities] = estimate[:, self._quantities].clip(self._least, self._most)

        at, share = (self._nearest_node(chosen, estimate), period), late[:, None] / self.task.period
        off = (estimate - tables.nominal[at])[:, : self._of_the_arm]
        torque = self.limited(self.regulator.torques(at, off, before, share, off[:, :0]))
        slope = tables.by_lateness(at, slope, before, torque, share)
        estimate = tables.predict(at, estimate, before, torque, share)
        return torque, (estimate, chosen, torque, late, variance, slope)

    def _later(
        self, at: Place, residual: Floats, slope: Floats, late: Floats, variance: Floats
    ) -> tuple[Floats, Floats]:
        """Return by how much later the motors are than was thought [s], and the variance of what is thought now [s^2].

        Args:
            at: tables and periods.
            residual: of the readings. Shape (n, r).
            slope: its derivative by lateness as a share of the period. Shape (n, r).
            late: what was thought [s]. Shape (n,).
            variance: of it [s^2]. Shape (n,).
        """
        period = self.task.period
        weighed = product(self.filter.information[at], slope) / period
        known = 1.0 + variance * np.sum(weighed * slope, axis=1) / period
        change = variance / known * np.sum(weighed * residual, axis=1)
        wandering = (LATENESS.drift * LATENESS.deviation) ** 2 * period
        after = np.minimum(variance / known + wandering, LATENESS.deviation**2)
        return (late + change).clip(LATENESS.least, LATENESS.most) - late, after

    def _nearest_node(self, chosen: Array, estimate: Floats) -> Array:
        """Return the place of the tables for the nearest payload and stiffness. Shape (n,)."""
        first = self._quantities.start
        payload, stiffness = (
            np.argmin(np.abs(estimate[:, first + n, None] - np.array(values)), axis=1)
            for n, values in enumerate(self._grid)
        )
        return np.asarray((payload * len(self._grid[1]) + stiffness) * len(self.plans) + chosen)
