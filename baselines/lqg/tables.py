"""What a Kalman filter and a regulator along plans come to: tables of matrices, computed once.

The filter is `KalmanFilter` linearised along a plan. Its covariance does not depend on what is read, so that its gains
are computed beforehand (Anderson and Moore, *Optimal Filtering*, 1979, chapter 3), and what is left to do in a control
period are products of matrices, for any number of arms at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np

from flexarm_baselines.along_plans import within_half_a_turn
from flexarm_baselines.arrays import Array, Floats, Integers
from flexarm_baselines.observers import KalmanFilter, Transition
from flexarm_baselines.optimal import LinearQuadratic, Plan, RegulatorWeights
from flexarm_env.simulation.arm import FlexibleArm

Place = tuple[Array, Array]  # plans and control periods of n arms. Shape (n,) each


def product(matrix: Floats, vector: Floats) -> Floats:
    """Multiply n matrices by n vectors. Shape (n, d)."""
    return np.asarray((matrix @ vector[..., None])[..., 0])


@dataclass(frozen=True)
class FilterTables:
    """A Kalman filter along l plans of N control periods; z is the mean of its `Estimate`, with d numbers.

    Attributes:
        nominal: z along the plan. Shape (l, N + 1, d).
        matrix: derivatives of the next z by z. Shape (l, N, d, d).
        by_torque: its derivatives by the torques. Shape (l, N, d, 2).
        torque: the plan's [N m]. Shape (l, N, 2).
        after: the next z of the filter's model that is on the plan; `nominal` if the plan is the model's own.
            Shape (l, N, d).
        gain: on the residuals of r readings. Shape (l, N, d, r).
        rows: place in z of each reading. Shape (r,).
    """

    nominal: Floats
    matrix: Floats
    by_torque: Floats
    torque: Floats
    after: Floats
    gain: Floats
    rows: Integers

    @classmethod
    def along(cls, kalman: KalmanFilter, plans: Sequence[Plan], gauges: bool = False) -> Self:
        """Linearise the filter along plans, and compute its gains.

        Args:
            kalman: the filter.
            plans: as long as each other.
            gauges: there are strain gauges.
        """
        count, periods = len(plans), len(plans[0].torques)
        states = np.stack([plan.states for plan in plans])
        torques = np.stack([plan.torques for plan in plans])
        moved = kalman.linearise(states[:, :-1].reshape(count * periods, -1), torques.reshape(-1, 2))
        along = Transition(*(part.reshape(count, periods, *part.shape[1:]) for part in moved))
        start = kalman.start(states[:, 0])
        rows, _ = kalman.sensors(gauges)
        there = np.ones((count, len(rows)), dtype=bool)
        nominal = np.empty((count, periods + 1, kalman.size))
        after = np.empty((count, periods, kalman.size))
        gain = np.empty((count, periods, kalman.size, len(rows)))
        nominal[:, 0], covariance = start.mean, start.covariance
        for k in range(periods):
            gain[:, k], covariance, _ = kalman.gain(covariance, there)
            transition = Transition(*(part[:, k] for part in along))
            covariance = kalman.spread(covariance, transition)
            after[:, k] = nominal[:, k + 1] = kalman.moved(nominal[:, k], transition)
            nominal[:, k + 1, : states.shape[2]] = states[:, k + 1]
        return cls(nominal, along.matrix, along.by_torque, torques, after, gain, np.array(rows))

    def correct(self, at: Place, estimate: Floats, readings: Floats) -> Floats:
        """Return z with what has been read. Shape (n, d).

        Args:
            at: plans and periods.
            estimate: z before it. Shape (n, d).
            readings: Shape (n, r).
        """
        return estimate + product(self.gain[at], within_half_a_turn(readings - estimate[:, self.rows]))

    def predict(self, at: Place, estimate: Floats, torque: Floats) -> Floats:
        """Return z a control period later. Shape (n, d).

        Args:
            at: plans and periods.
            estimate: z. Shape (n, d).
            torque: that acts [N m]. Shape (n, 2).
        """
        by_state = product(self.matrix[at], estimate - self.nominal[at])
        return self.after[at] + by_state + product(self.by_torque[at], torque - self.torque[at])


@dataclass(frozen=True)
class RegulatorTables:
    """A regulator along l plans of N control periods.

    Attributes:
        torque: the plan's, or 0 without feed-forward [N m]. Shape (l, N, 2).
        gain: on the deviation of the arm's state [N m/x]. Shape (l, N, 2, 4 + 4 m).
        integral: on the integral of the tip's deviation [N m/(m s)]. Shape (l, N, 2, 2).
    """

    torque: Floats
    gain: Floats
    integral: Floats

    @classmethod
    def along(
        cls,
        plans: Sequence[Plan],
        weights: RegulatorWeights,
        model: FlexibleArm,
        integral: float | None = None,
        feed_forward: bool = True,
    ) -> Self:
        """Compute the gains of `PlanRegulator`, with integral action if it is wanted.

        Args:
            plans: as long as each other.
            weights: see `RegulatorWeights`.
            model: arm that is linearised along the plans.
            integral: integral of the tip's deviation that weighs as much as the deviations of the weights do [m s];
                None: no integral action.
            feed_forward: the plans' torques act.
        """
        problems = [LinearQuadratic.along(plan, weights, model) for plan in plans]
        if integral is not None:
            problems = [problem.with_integral(integral) for problem in problems]
        gains = np.stack([problem.gains() for problem in problems])
        size = plans[0].states.shape[1]
        of_integral = np.zeros((*gains.shape[:3], 2)) if integral is None else gains[..., size:]
        torques = np.stack([plan.torques for plan in plans]) * float(feed_forward)
        return cls(torques, np.ascontiguousarray(gains[..., :size]), np.ascontiguousarray(of_integral))

    def torques(self, at: Place, deviation: Floats, integral: Floats) -> Floats:
        """Return the torques without their limits [N m]. Shape (n, 2).

        Args:
            at: plans and periods.
            deviation: of the state from the plan. Shape (n, 4 + 4 m).
            integral: of the tip's deviation [m s]. Shape (n, 2).
        """
        return self.torque[at] + product(self.gain[at], deviation) + product(self.integral[at], integral)
