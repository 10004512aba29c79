"""`HInfinityLQG`: the central H-infinity controller along the plan, which reckons with the worst disturbance.

A disturbance that plays against the controller has a budget; the controller guarantees that the cost is at most gamma^2
times the budget. At the optimum the estimate is pulled towards states that cost more, and both Riccati recursions have
a term in 1 / gamma^2. With an infinite gamma it is LQG. Sources: Whittle, *Risk-sensitive optimal
control*, 1990, chapters 7, 8; Basar and Bernhard, *H-infinity-optimal control*, 1995, chapters 3, 6 (discrete time).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from flexarm_baselines.arrays import Floats, product
from flexarm_baselines.lqg.controller import LQG, NOISE, WEIGHTS
from flexarm_baselines.lqg.tables import Place
from flexarm_baselines.observers import KalmanFilter, NoiseModel, Transition
from flexarm_baselines.optimal import LinearQuadratic, Plan, RegulatorWeights
from flexarm_baselines.optimal.linear_quadratic import ENDURING
from flexarm_baselines.task import Task
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import number

# The laps begin at rest where the encoders say: an unknown start would be the worst disturbance of all. Standard
# deviations of angles [rad], deflections [m] and rates [rad/s], [m/s].
KNOWN = replace(NOISE, start_joint=1e-3, start_mode=1e-3, start_rate=1e-3)
GAMMA = 18.0  # a tenth above `least_gamma`


class Game(NamedTuple):
    """The game of deviations z from l plans over n periods.

    Attributes:
        kalman: the filter that knows the sensors.
        along: the periods, linearised. Shapes (l, n, ...).
        noise: covariance of what the disturbance does in a period. Shape (l, n, d, d).
        cost: of z. Shape (l, n, d, d).
        effort: of the torques. Shape (2, 2).
        start: covariance of z at the start. Shape (l, d, d).
    """

    kalman: KalmanFilter
    along: Transition
    noise: Floats
    cost: Floats
    effort: Floats
    start: Floats

    @classmethod
    def of(cls, task: Task, plans: Sequence[Plan], weights: RegulatorWeights, noise: NoiseModel) -> Game:
        """Linearise the task's arm along plans."""
        arm = FlexibleArm(task.arm)
        kalman = KalmanFilter(arm, task.period, task.delay, task.sensor_position, noise)
        states = np.stack([plan.states[:-1] for plan in plans])
        torques, shape = np.stack([plan.torques for plan in plans]), states.shape[:2]
        flat = kalman.linearise(states.reshape(-1, states.shape[-1]), torques.reshape(-1, 2))
        along = Transition(*(part.reshape(*shape, *part.shape[1:]) for part in flat))
        still = along._replace(matrix=np.zeros_like(along.matrix))
        nothing = np.zeros((len(plans), kalman.size, kalman.size))
        disturbed = [kalman.spread(nothing, Transition(*(part[:, k] for part in still))) for k in range(shape[1])]
        cost = np.zeros_like(along.matrix)
        own = [LinearQuadratic.along(plan, weights, arm).cost[:-1] for plan in plans]
        cost[..., : states.shape[-1], : states.shape[-1]] = np.stack(own)
        effort, start = np.diag(1.0 / np.square(weights.torque)), kalman.start(states[:, 0]).covariance
        return cls(kalman, along, np.stack(disturbed, axis=1), cost, effort, start)

    def values(self, theta: float) -> tuple[Floats, Floats] | None:
        """Solve the controller's recursion backward, from the last linearisation's enduring one; theta: 1 / gamma^2.

        Returns:
            Cost-to-go P, Shape (l, n, d, d), and gains on z, Shape (l, n, 2, d); None: gamma cannot be guaranteed.
        """
        more, count = round(ENDURING / self.kalman.period), self.cost.shape[1]
        periods = [*range(count), *[count - 1] * more]
        to_go, eye = self.cost[:, -1], np.eye(self.kalman.size)
        found, gains = np.empty_like(self.cost), np.empty_like(self.along.by_torque.swapaxes(2, 3), order="C")
        for n, k in zip(reversed(range(len(periods))), reversed(periods), strict=True):
            matrix, by_torque, noise = self.along.matrix[:, k], self.along.by_torque[:, k], self.noise[:, k]
            if theta * _radius(noise, to_go) >= 1.0:
                return None
            worst = to_go @ np.linalg.inv(eye - theta * noise @ to_go)
            driven = by_torque.swapaxes(1, 2) @ worst
            gain = -np.linalg.solve(self.effort + driven @ by_torque, driven @ matrix)
            to_go = self.cost[:, k] + matrix.swapaxes(1, 2) @ worst @ (matrix + by_torque @ gain)
            to_go = 0.5 * (to_go + to_go.swapaxes(1, 2))
            if n < count:
                found[:, k], gains[:, k] = to_go, gain
        return found, gains

    def covariances(self, theta: float) -> tuple[Floats, Floats, Floats] | None:
        """Solve the filter's recursion forward.

        Returns:
            Covariances before and after each correction, Shape (l, n, d, d) each, and gains on r readings,
            Shape (l, n, d, r); None: gamma cannot be guaranteed.
        """
        doubt, eye = self.start, np.eye(self.kalman.size)
        there = np.ones((len(doubt), len(self.kalman.sensors()[0])), dtype=bool)
        before, found = np.empty_like(self.cost), np.empty_like(self.cost)
        gains = np.empty((*self.cost.shape[:3], there.shape[1]))
        for k in range(self.cost.shape[1]):
            before[:, k] = doubt
            gains[:, k], doubt, _ = self.kalman.gain(doubt, there)
            found[:, k] = doubt
            if theta * _radius(doubt, self.cost[:, k]) >= 1.0:
                return None
            doubt = np.asarray(np.linalg.solve(eye - theta * doubt @ self.cost[:, k], doubt), dtype=np.float64)
            matrix = self.along.matrix[:, k]
            doubt = matrix @ doubt @ matrix.swapaxes(1, 2) + self.noise[:, k]
            doubt = 0.5 * (doubt + doubt.swapaxes(1, 2))
        return before, found, gains

    def solved(self, gamma: float) -> Solution | None:
        """Return both recursions' gains, coupled; None: gamma cannot be guaranteed."""
        theta = 1.0 / gamma**2
        regulator, filtered = self.values(theta), self.covariances(theta)
        if regulator is None or filtered is None:
            return None
        (to_go, gains), (before, doubt, corrections), eye = regulator, filtered, np.eye(self.kalman.size)
        if theta * _radius(before, to_go) >= 1.0:
            return None
        coupled = gains @ np.linalg.inv(eye - theta * doubt @ to_go)
        pull = np.linalg.inv(eye - theta * doubt @ self.cost) - eye
        return Solution(coupled, corrections, pull)


class Solution(NamedTuple):
    """Gains of the controller."""

    regulator: Floats  # on the estimated deviations. Shape (l, n, 2, d)
    correction: Floats  # on the residuals of r readings. Shape (l, n, d, r)
    pull: Floats  # on estimated deviations, by which they go towards what costs. Shape (l, n, d, d)


class HInfinityLQG(LQG):
    """The central H-infinity controller of deviations from a plan, with the weights and covariances of `LQG`.

    Attributes:
        solution: see `Solution`.
    """

    def __init__(
        self,
        task: Task,
        plans: Sequence[Plan] | None = None,
        gamma: float = GAMMA,
        weights: RegulatorWeights = WEIGHTS,
        noise: NoiseModel = KNOWN,
    ) -> None:
        """Solve the game.

        Args:
            task: see `Task`.
            plans: see `LQG`.
            gamma: bound on the closed loop's gain from weighed disturbances to weighed deviations.
            weights: see `LQG`.
            noise: see `LQG`.

        Raises:
            ValueError: if no controller guarantees gamma, the payload changes on the way, torques act late, or as in
                `LQG`.
        """
        if task.payloads is not None:
            raise ValueError("env: payload_changes: the game has one payload throughout")
        if task.actuation_delay:
            raise ValueError(f"env: actuation_delay = {task.actuation_delay} s: must be 0, the game has no late motors")
        super().__init__(task, plans, weights=weights, noise=noise)
        found = Game.of(task, self.plans, weights, noise).solved(number("gamma", gamma, above=0.0))
        if found is None:
            raise ValueError(f"gamma = {gamma}: no controller guarantees it; the least is that of `least_gamma`")
        self.solution, self.filter = found, replace(self.filter, gain=found.correction)

    def _driven(
        self, at: Place, estimate: Floats, before: Floats, late: Floats, integral: Floats
    ) -> tuple[Floats, Floats]:
        """Command the torques of the worst case, and pull the estimate towards it."""
        off = estimate - self.filter.nominal[at]
        wanted = self.regulator.torque[at] + product(self.solution.regulator[at], off)
        return wanted, estimate + product(self.solution.pull[at], off)


def least_gamma(game: Game, low: float = 1.0, high: float = 1e5) -> float:
    """Return the least gamma that a controller guarantees, to 1 %, by bisection of its logarithm from `low` to `high`.

    Raises:
        ValueError: if `low` is guaranteed, or `high` is not.
    """
    if game.solved(number("low", low, above=0.0)) or not game.solved(number("high", high, above=low)):
        raise ValueError(f"low = {low}, high = {high}: a controller must guarantee high, and none low")
    while high / low > 1.01:
        middle = float(np.sqrt(low * high))
        low, high = (low, middle) if game.solved(middle) else (middle, high)
    return high


def _radius(one: Floats, other: Floats) -> float:
    """Return the largest eigenvalue of the products of two tables of symmetric, positive semidefinite matrices."""
    return float(np.abs(np.linalg.eigvals(one @ other)).max())
