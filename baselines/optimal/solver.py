"""Differential dynamic programming with box constraints: the best torques of a run by sweeps of its quadratic model.

Each iteration differentiates all control periods of the present trajectory exactly, sweeps backward for steps and
feedback gains that keep torques within their limits, and rolls the arm out under ``clip(u + alpha k + K (z - z0))``
for several alpha at once, of which the best is taken. At first curvature of the dynamics is left out and that of the
cost is Gauss-Newton's (iterative LQR), so that each sweep's model is convex. Where progress becomes slow, curvature of
the dynamics comes in, by differences of exact gradients, and iterations converge as Newton's. A Levenberg-Marquardt
term bounds steps.

Sources: Jacobson & Mayne, *Differential Dynamic Programming*, 1970; Li & Todorov, *Iterative linear quadratic regulator
design for nonlinear biological movement systems*, ICINCO 2004; Tassa, Mansard & Todorov, *Control-limited differential
dynamic programming*, ICRA 2014 (box constraints, regularisation, acceptance).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal.adjoint import torque_gradient
from flexarm_baselines.optimal.kernels import Model
from flexarm_baselines.optimal.problem import DIVERGED, Expansion, TrackingProblem
from flexarm_baselines.optimal.sweep import sweep
from flexarm_env.simulation.feedback import Rollout
from flexarm_env.validation import finite_array, integer, number

STEP_LENGTHS = np.array([1.0, 0.75, 0.5, 0.3, 0.15, 0.05, 0.01, 0.001])  # alpha, tried side by side
LEAST_GAIN = 1e-4  # share of the expected decrease that a step must bring
# Least (below: none), first and largest [m^2], as a weight on changes of the torques; the first gives the feedback that
# acts while the residual of optimality is measured.
REGULARISATION = (1e-9, 0.1, 1e4)
FACTOR = 4.0
SLOW = 1e-4  # relative decrease of the cost below which the curvature of the dynamics is included
DIFFERENCE = 1e-6  # of a state's entries for second derivatives; of torques 1000 times as large


@dataclass(frozen=True)
class SolverOptions:
    """When to stop.

    Attributes:
        iterations: most iterations.
        tolerance: residual of optimality (`Iteration.residual`) that is small enough.
    """

    iterations: int = 300
    tolerance: float = 1e-4

    def __post_init__(self) -> None:
        """Check the numbers."""
        integer("iterations", self.iterations, 0)
        number("tolerance", self.tolerance, above=0.0)


class Iteration(NamedTuple):
    """A line of the solver's log.

    Attributes:
        cost: of the trajectory, see `TrackingProblem` [m^2].
        residual: of optimality: by how much, to first order and relative to the cost, the torques could lower the cost
            within their limits for each unit of their r.m.s. change, as a share of the limits (the norm of the
            projected gradient).
        step_length: alpha that led to it; 0 where none did.
        regularisation: of the sweep that led to it, as `REGULARISATION` [m^2].
    """

    cost: float
    residual: float
    step_length: float
    regularisation: float


class DivergingStartError(ValueError):
    """A start that diverges (`problem.DIVERGED`)."""


class Solution(NamedTuple):
    """What the solver found.

    Attributes:
        run: states and torques.
        gains: on the state and on the torque of the period before, of the last sweep. Shape (n, 2, 6 + 4 m).
        log: of each iteration, the start first.
        converged: whether the residual of optimality met the tolerance.
    """

    run: Rollout
    gains: Floats
    log: tuple[Iteration, ...]
    converged: bool


def optimise(
    problem: TrackingProblem,
    start: Rollout,
    options: SolverOptions | None = None,
    progress: Callable[[Iteration], object] | None = None,
) -> Solution:
    """Improve a run until no torque within the limits makes it better to first order.

    Args:
        problem: what the run should be good at.
        start: a run of the problem's arm from its initial state, e.g. of `starts`; its torques are replayed.
        options: when to stop.
        progress: called after each iteration.

    Raises:
        DivergingStartError: if the start diverges.
    """
    options = SolverOptions() if options is None else options
    search = Search(problem, start)
    log = [Iteration(search.cost, search.residual, 0.0, 0.0)]
    while log[-1].residual > options.tolerance and len(log) <= options.iterations:
        moved = search.improve()
        log.append(Iteration(search.cost, search.residual, *moved))
        if progress is not None:
            progress(log[-1])
        if moved[0] == 0.0:
            break
    return Solution(search.run, search.gains, tuple(log), log[-1].residual <= options.tolerance)


class Search:
    """A trajectory with the model about it.

    Attributes:
        run: the trajectory.
        cost: its cost.
        residual: of optimality, see `Iteration.residual`.
        gains: on the state and on the torque of the period before. Shape (n, 2, 6 + 4 m).
        exact: whether the model has the curvature of the dynamics.
    """

    def __init__(self, problem: TrackingProblem, start: Rollout) -> None:
        """Replay a start, and expand about it; arguments and errors as in `optimise`."""
        self.problem = problem
        self.limits = np.array(problem.limits)
        if not np.all(np.isfinite(start.torques)):  # of feedback on a state that is not finite
            raise DivergingStartError("start: it diverges, its torques are not finite")
        torques = finite_array("start.torques", start.torques, (problem.periods, 2))
        self.run = rollout(problem, np.clip(torques, -self.limits, self.limits))
        self.cost = float(problem.cost(self.run))
        if not np.isfinite(self.cost):
            largest = np.abs(self.run.states).max()
            raise DivergingStartError(f"start: it diverges, a state has {largest:.3g}; at most {DIVERGED:g} is allowed")
        self.regularisation, self.growth = REGULARISATION[1], 1.0
        self.curvature: Floats | None = None
        self.exact = False
        self.differentiate()

    def differentiate(self) -> None:
        """Expand dynamics and cost about the run, and find the residual of optimality."""
        states, torques = self.run
        problem = self.problem
        found = problem.arm.step_jacobians(states[:-1], torques, problem.period, step=problem.step)
        self.slopes = found.by_state, found.by_torque
        self.expansion = problem.expand(states)
        self.curvature = None
        self.backward(REGULARISATION[1])
        residual, by_end = optimality(problem, self.run, self.slopes, self.expansion, self.gains)
        self.residual = residual / self.cost if self.cost > 0.0 else 0.0  # nothing is better than no cost
        if self.exact:
            self.curvature = dynamics_curvature(problem, self.run, self.slopes, by_end)
        self.expected = self.backward(self.regularisation)

    def improve(self) -> tuple[float, float]:
        """Roll out and choose a step, with more and more regularisation until one helps.

        Returns:
            Step length, 0 if no step helps, and regularisation.
        """
        while True:
            run, costs = self.forward_pass()
            best = int(np.argmin(costs))
            alpha, used = float(STEP_LENGTHS[best]), self.regularisation
            decrease = self.cost - costs[best]
            wanted = -alpha * (self.expected[0] + alpha * self.expected[1])
            if decrease > LEAST_GAIN * max(wanted, 0.0):
                self.run = Rollout(run.states[best], run.torques[best])
                self.exact = self.exact or decrease < SLOW * self.cost
                self.cost = float(costs[best])
                self.adapt(alpha >= 0.5)
                self.differentiate()
                return alpha, used
            self.adapt(False)
            if self.regularisation > REGULARISATION[2]:
                return 0.0, used
            self.expected = self.backward(self.regularisation)

    def adapt(self, good: bool) -> None:
        """Lower the regularisation after a good step, raise it after another, quicker and quicker (Tassa)."""
        if good:
            self.growth = min(1.0 / FACTOR, self.growth / FACTOR)
            lowered = self.regularisation * self.growth
            self.regularisation = lowered if lowered > REGULARISATION[0] else 0.0
        else:
            self.growth = max(FACTOR, self.growth * FACTOR)
            self.regularisation = max(REGULARISATION[0], self.regularisation) * self.growth

    def backward(self, regularisation: float) -> Floats:
        """Find steps and gains about the run; return the change of cost that they predict, by order."""
        problem, (gradient, hessian, weights) = self.problem, self.expansion
        torques = problem.with_torque_before(self.run.torques)
        model = Model(*self.slopes, gradient, hessian, weights, torques, curvature=self.curvature)
        found = sweep(model, self.limits, 2.0 * regularisation / (problem.periods * self.limits**2))
        self.forward, self.gains = found.forward, found.gains
        return found.expected

    def forward_pass(self) -> tuple[Rollout, Floats]:
        """Run the arm under all step lengths, and compute the costs."""
        states, torques = self.run
        before = self.problem.with_torque_before(torques)[:-1]
        size = states.shape[1]
        on_torque = np.ascontiguousarray(self.gains[:, :, size:])
        offset = torques - np.einsum("tij,tj->ti", on_torque, before)
        forward = offset + STEP_LENGTHS[:, None, None] * self.forward
        run = rollout(
            self.problem,
            forward,
            gains=self.gains[:, :, :size],
            references=states[:-1],
            torque_gains=on_torque,
        )
        return run, self.problem.cost(run)


def rollout(problem: TrackingProblem, torques: ArrayLike, **feedback: Floats) -> Rollout:
    """Run the problem's arm from its start under torques and feedback; see `FlexibleArm.rollout`."""
    return problem.arm.rollout(
        problem.initial_state,
        torques,
        torque_before=problem.torque_before,
        limits=problem.limits,
        period=problem.period,
        step=problem.step,
        **feedback,
    )


def optimality(
    problem: TrackingProblem, run: Rollout, slopes: tuple[Floats, Floats], expansion: Expansion, gains: Floats
) -> tuple[float, Floats]:
    """Return the norm of the projected gradient of the cost by the feed-forward torques; see `Iteration.residual`.

    A torque at its limit counts only where the cost falls inward.

    Args:
        problem: the problem.
        run: a trajectory.
        slopes: derivatives of each period's end by state and torque.
        expansion: of the cost about the run.
        gains: of the feedback that acts meanwhile. Shape (n, 2, 6 + 4 m).

    Returns:
        The norm, and the derivatives by the state at each period's end. Shape (n, 4 + 4 m).
    """
    limits = np.array(problem.limits)
    gradient, by_end = np.empty_like(run.torques), np.empty_like(run.states[1:])
    torques = problem.with_torque_before(run.torques)
    torque_gradient(*slopes, expansion.gradient, expansion.weights, torques, gains, gradient, by_end)
    outward = ((run.torques >= limits) & (gradient < 0.0)) | ((run.torques <= -limits) & (gradient > 0.0))
    projected = np.where(outward, 0.0, gradient * limits)
    return float(np.sqrt(problem.periods * np.sum(projected**2))), by_end


def dynamics_curvature(problem: TrackingProblem, run: Rollout, slopes: tuple[Floats, Floats], by_end: Floats) -> Floats:
    """Return second derivatives of each period's end by state and torque, in the direction of the cost's slope.

    They are forward differences of the exact gradients. Nothing depends on theta1 but by a rotation, which is linear in
    it: its row and column are 0.

    Args:
        problem: the problem.
        run: a trajectory.
        slopes: its derivatives of each period's end by state and torque.
        by_end: derivatives of the cost by the state at each period's end. Shape (n, 4 + 4 m).
    """
    periods, size = by_end.shape
    inputs = np.concatenate([run.states[:-1], run.torques], axis=1)
    shifts = np.full(size + 2, DIFFERENCE)
    shifts[size:] *= 1e3

    def along(states_and_torques: Floats) -> Floats:
        states, torques = np.split(states_and_torques, [size], axis=-1)
        found = problem.arm.step_gradients(states, torques, by_end, problem.period, step=problem.step)
        return np.concatenate(found, axis=-1)

    base = np.concatenate([np.matmul(by_end[:, None], slope)[:, 0] for slope in slopes], axis=1)
    found = np.zeros((periods, size + 2, size + 2))
    for n in range(1, size + 2):
        found[:, n] = (along(inputs + shifts[n] * (np.arange(size + 2) == n)) - base) / shifts[n]
    return 0.5 * (found + found.swapaxes(1, 2))
