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

from flexarm_baselines.arrays import Floats, Integers
from flexarm_baselines.observers import KalmanFilter
from flexarm_baselines.optimal import LinearQuadratic, Plan, RegulatorWeights
from flexarm_env.simulation.arm import FlexibleArm

Place = tuple[Integers, Integers]  # laps and periods of n arms. Shape (n,) each


def product(matrix: Floats, vector: Floats) -> Floats:
    """Multiply n matrices by n vectors. Shape (n, d)."""
    return np.asarray((matrix @ vector[..., None])[..., 0])


@dataclass(frozen=True)
class FilterTables:
    """A Kalman filter along plans: l laps of N control periods, d numbers of its state z, r readings.

    Attributes:
        nominal: z along the plan. Shape (l, N + 1, d).
        matrix: derivatives of the next z by z. Shape (l, N, d, d).
        by_torque: its derivatives by the torques. Shape (l, N, d, 2).
        torque: the plan's [N m]. Shape (l, N, 2).
        drift: the model's next z from the plan's, minus the plan's next; 0 for the planned arm. Shape (l, N, d).
        gain: on the residuals of the readings. Shape (l, N, d, r).
        rows: place in z of each reading. Shape (r,).
    """

    nominal: Floats
    matrix: Floats
    by_torque: Floats
    torque: Floats
    drift: Floats
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
        periods, laps = len(plans[0].torques), len(plans)
        states = np.stack([plan.states for plan in plans])
        torques = np.stack([plan.torques for plan in plans])
        moved = kalman.linearise(states[:, :-1].reshape(laps * periods, -1), torques.reshape(-1, 2))
        by_lap = [part.reshape(laps, periods, *part.shape[1:]) for part in moved]
        start = kalman.start(states[:, 0])
        after, seen, matrix, by_torque = by_lap
        nominal = np.empty((laps, periods + 1, kalman.size))
        nominal[:, 0] = start.mean
        drift = np.zeros((laps, periods, kalman.size))
        drift[:, :, : states.shape[2]] = after - states[:, 1:]
        rows, deviations = kalman.sensors(gauges)
        there = np.ones((laps, len(deviations)), dtype=bool)
        gain, covariance = np.empty((laps, periods, kalman.size, len(rows))), start.covariance
        known = kalman.size - nominal.shape[2] + states.shape[2]
        for k in range(periods):
            gain[:, k], covariance, _ = kalman.gain(covariance, there)
            covariance = kalman.spread(covariance, type(moved)(*(part[:, k] for part in by_lap)))
            nominal[:, k + 1] = np.concatenate([states[:, k + 1], seen[:, k], nominal[:, k, known:-2]], axis=1)
        return cls(nominal, matrix, by_torque, torques, drift, gain, np.array(rows))

    def predict(self, at: Place, deviation: Floats, torque: Floats) -> Floats:
        """Return the deviations of z from the plan a control period later.

        Args:
            at: laps and periods of n arms.
            deviation: of z. Shape (n, d).
            torque: that acts [N m]. Shape (n, 2).
        """
        change = torque - self.torque[at]
        return product(self.matrix[at], deviation) + product(self.by_torque[at], change) + self.drift[at]


@dataclass(frozen=True)
class RegulatorTables:
    """A regulator along plans, l laps of N control periods.

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
        model: FlexibleArm | None = None,
        integral: float | None = None,
        feed_forward: bool = True,
    ) -> Self:
        """Compute the gains of `PlanRegulator`, with integral action if it is wanted.

        Args:
            plans: as long as each other.
            weights: see `RegulatorWeights`.
            model: arm that is linearised along the plans; None: that of each plan.
            integral: integral of the tip's deviation that weighs as much as the deviations of the weights do [m s];
                None: no integral action.
            feed_forward: the plans' torques act.
        """
        problems = [LinearQuadratic.along(plan, weights, plan.arm if model is None else model) for plan in plans]
        if integral is not None:
            problems = [problem.with_integral(integral) for problem in problems]
        gains = np.stack([problem.gains() for problem in problems])
        size = plans[0].states.shape[1]
        torques = np.stack([plan.torques for plan in plans]) * float(feed_forward)
        of_integral = np.zeros((*gains.shape[:3], 2)) if integral is None else gains[..., size:]
        return cls(torques, np.ascontiguousarray(gains[..., :size]), np.ascontiguousarray(of_integral))

    def feedback(self, at: Place, deviation: Floats, integral: Floats) -> Floats:
        """Return the torques that are added for deviations from the plan [N m]. Shape (n, 2).

        Args:
            at: laps and periods of n arms.
            deviation: of the state, and what else an observer estimates. Shape (n, d).
            integral: of the tip's deviation [m s]. Shape (n, 2).
        """
        gain = self.gain[at]
        return product(gain, deviation[:, : gain.shape[2]]) + product(self.integral[at], integral)
