"""What a plan is to be good at: the tip on a timed reference, with torques that are small and smooth, within limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.tangents import jacobian
from flexarm_env.codegen.tracing import at_least, magnitude
from flexarm_env.formulas import tip
from flexarm_env.physics.linear_algebra import dot
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.feedback import Rollout
from flexarm_env.simulation.open_loop import LARGEST
from flexarm_env.validation import finite_array, finite_values, instance, number, pair, shown

# From the state's 4 + 4 m numbers (or arrays, an entry for each instant) and the time [s] to numbers whose squares are
# added to the cost. It is differentiated by dual numbers: sums, products, quotients, and `codegen.elementary`.
Residuals = Callable[[Sequence[Any], Any], Sequence[Any]]

DEFLECTION_WEIGHT = 100.0  # on squared deflections beyond the limit
LEAST_WEIGHT = 1e-30  # on squared torques [m^2]; products of it are still more than 0


class Expansion(NamedTuple):
    """The cost of a trajectory to second order in its states, with the curvature of its squares only (Gauss-Newton).

    Attributes:
        gradient: by each state. Shape (n + 1, 4 + 4 m).
        hessian: Shape (n + 1, 4 + 4 m, 4 + 4 m).
        weights: on squared torques, and on their squared changes [m^2/(N m)^2]. Shape (2, 2).
    """

    gradient: Floats
    hessian: Floats
    weights: Floats


DIVERGED = 1e6  # of any coordinate or rate, beyond which a run has diverged [rad, m, rad/s, m/s]


@dataclass(frozen=True, eq=False)
class TrackingProblem:
    """A run of n control periods that is to keep the tip on a reference.

    The cost is a mean square error with weights, in m^2:

        mean_t w_t |tip(x_t) - reference_t|^2
          + torque_weight mean_t |u_t / limits|^2 + change_weight mean_t |(u_t - u_(t-1)) / limits|^2
          + mean_t sum r_j(x_t, t)^2 + 100 mean_t sum max(|d_i(x_t)| - deflection_limit, 0)^2,

    the first and last mean over the n + 1 instants, the others over the n periods, u_(-1) = `torque_before`.

    Attributes:
        arm: the arm.
        initial_state: where it starts. Shape (4 + 4 m,).
        reference: where the tip should be at each instant [m]. Shape (n + 1, 2).
        limits: largest torques of shoulder and elbow [N m].
        tip_weights: w at each instant [1]; one number for all. Shape (n + 1,).
        torque_weight: [m^2]; 1e-30 at least: without one there may be no best torque.
        change_weight: [m^2].
        torque_before: torque before the first period [N m].
        deflection_limit: of the links' tip deflections d [m]; None: none. It is soft: leave a margin.
        residuals: what a user adds: r, a function of state and time.
        period: control period [s].
        step: integration step [s]; a period is a whole number of them.
    """

    arm: FlexibleArm
    initial_state: Floats
    reference: Floats
    limits: tuple[float, float] = (150.0, 50.0)
    tip_weights: Floats | float = 1.0
    torque_weight: float = 1e-6
    change_weight: float = 1e-5
    torque_before: tuple[float, float] = (0.0, 0.0)
    deflection_limit: float | None = None
    residuals: Residuals | None = None
    period: float = 0.01
    step: float = 1e-3
    weights: Floats = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check all; arrays are copied."""
        instance("arm", self.arm, FlexibleArm)
        if self.residuals is not None and not callable(self.residuals):
            raise TypeError(f"residuals = {shown(self.residuals)}: must be a function of state and time, or None")
        put = object.__setattr__
        put(self, "initial_state", finite_array("initial_state", self.initial_state, (2 * self.arm.size,)))
        put(self, "reference", finite_array("reference", self.reference, (None, 2)))
        if len(self.reference) < 2:
            raise ValueError(f"reference: must have two instants at least, got {len(self.reference)}")
        put(self, "limits", pair("limits", self.limits, "N m", least=1.0 / LARGEST, most=LARGEST))
        put(self, "torque_before", pair("torque_before", self.torque_before, "N m"))
        weights = finite_values("tip_weights", self.tip_weights)
        one_for_all = weights.ndim == 0
        weights = finite_array(
            "tip_weights", np.full(len(self.reference), weights) if one_for_all else weights, (len(self.reference),)
        )
        if np.any(weights < 0.0):
            raise ValueError(f"tip_weights[{int(np.argmin(weights))}] = {weights.min()}: must be >= 0")
        put(self, "tip_weights", weights)
        number("torque_weight", self.torque_weight, "m^2", least=LEAST_WEIGHT)
        number("change_weight", self.change_weight, "m^2", least=0.0)
        if self.deflection_limit is not None:
            number("deflection_limit", self.deflection_limit, "m", above=0.0)
        number("period", self.period, "s", above=0.0)
        number("step", self.step, "s", above=0.0)
        per_square = 1.0 / (self.periods * np.square(self.limits))
        put(self, "weights", np.array([self.torque_weight * per_square, self.change_weight * per_square]))

    @property
    def periods(self) -> int:
        """Number of control periods, n."""
        return len(self.reference) - 1

    @property
    def time(self) -> Floats:
        """Times of the instants [s]. Shape (n + 1,)."""
        return self.period * np.arange(self.periods + 1.0)

    def cost(self, run: Rollout) -> Floats:
        """Return the cost of one run or of many; infinite where a state exceeds `DIVERGED`. Shape (...)."""
        with np.errstate(over="ignore", invalid="ignore"):
            errors = self.residual_values(run.states)
            torques = self.with_torque_before(run.torques)
            squares = np.stack(
                [np.sum(torques[..., 1:, :] ** 2, axis=-2), np.sum(np.diff(torques, axis=-2) ** 2, axis=-2)], axis=-2
            )
            total = np.sum(errors**2, axis=(-2, -1)) + np.sum(self.weights * squares, axis=(-2, -1))
            stays = np.max(np.abs(run.states), axis=(-2, -1)) <= DIVERGED
        return np.where(stays, total, np.inf)

    def residual_values(self, states: Floats) -> Floats:
        """Return numbers whose squares add up to the states' part of the cost. Shape (..., n + 1, residuals)."""
        found = self._residuals(list(np.moveaxis(states, -1, 0)))
        return np.stack([np.broadcast_to(x, states.shape[:-1]) for x in found], axis=-1)

    def expand(self, states: Floats) -> Expansion:
        """Expand the cost of states about a trajectory.

        Args:
            states: Shape (n + 1, 4 + 4 m).
        """
        values, slopes = jacobian(self._residuals, states)
        gradient = 2.0 * np.einsum("ti,tij->tj", values, slopes)
        hessian = 2.0 * np.matmul(slopes.swapaxes(-1, -2), slopes)
        return Expansion(gradient, hessian, self.weights)

    def with_torque_before(self, torques: Floats) -> Floats:
        """Return torques of each period, with that before the first in front. Shape (..., n + 1, 2)."""
        before = np.broadcast_to(self.torque_before, (*torques.shape[:-2], 1, 2))
        return np.concatenate([before, torques], axis=-2)

    def _residuals(self, state: Sequence[Any]) -> list[Any]:
        per_instant = 1.0 / (self.periods + 1.0)
        scales = np.sqrt(self.tip_weights * per_instant)
        at = tip(self.arm, state, lambda x: sincos(x)[0], lambda x: sincos(x)[1])
        found = [(at[axis] - self.reference[:, axis]) * scales for axis in range(2)]
        if self.deflection_limit is not None:
            scale = np.sqrt(DEFLECTION_WEIGHT * per_instant)
            found += [at_least(magnitude(d) - self.deflection_limit, 0.0) * scale for d in self._deflections(state)]
        if self.residuals is not None:
            found += [r * np.sqrt(per_instant) for r in self.residuals(state, self.time)]
        return found

    def _deflections(self, state: Sequence[Any]) -> list[Any]:
        """Return the deflection of each link's tip off its root tangent."""
        m = self.arm.parameters.modes_per_link
        return [
            dot(link.tip_values.tolist(), state[2 + n * m : 2 + (n + 1) * m]) for n, link in enumerate(self.arm.modes)
        ]
