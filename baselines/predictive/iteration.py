"""One iteration of optimisation in each control period, from the prediction of the period before.

The horizon moves by a period each time, and the prediction with it, so that a single iteration keeps it near its
optimum (real-time iteration: Diehl, Bock and Schloeder, *A real-time iteration scheme for nonlinear optimization in
optimal feedback control*, SIAM J. Control and Optimization 43, 2005). An iteration is one of `optimal.solver`: exact
Jacobians, a backward sweep with box constraints (Tassa, Mansard and Todorov, ICRA 2014), and a roll-out from the
present state under ``clip(u + alpha k + K (z - z0))`` for several alpha side by side. The cost of what follows the
horizon is that along the guide, to second order. The guide's own feedback law is tried beside the steps, so that a
prediction that went astray is left at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_baselines.optimal.solver import STEP_LENGTHS
from flexarm_baselines.optimal.sweep import CostToGo, Model, Sweep, sweep
from flexarm_baselines.predictive import kernels
from flexarm_baselines.predictive.guide import Guide
from flexarm_env.physics.sensing import Outputs
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.feedback import Rollout

ALPHAS = STEP_LENGTHS[:-1]  # with the guide's law they fill the lanes of a roll-out


class Instant(NamedTuple):
    """Where an arm is.

    Attributes:
        run: place of its run in the guide.
        period: control period of the lap that begins.
        state: Shape (n,).
        before: torque of the period that ends [N m]. Shape (2,).
        quantities: of the arm, as `FlexibleArm.step` takes them.
    """

    run: int
    period: int
    state: Floats
    before: Floats
    quantities: dict[str, float]


class _Law(NamedTuple):
    """A feedback law as `FlexibleArm.rollout` takes it; `gains` are on state and torque before."""

    forward: Floats
    gains: Floats
    references: Floats


class RealTimeIteration:
    """Improves predictions of one arm.

    Attributes:
        model: the arm.
        guide: see `Guide`.
        horizon: control periods.
        limits: largest torques [N m]. Shape (2,).
        damping: regularisation of the sweep, in units of a weight on changes of the torques [m^2].
        step: integration step [s].
    """

    def __init__(
        self,
        model: FlexibleArm,
        guide: Guide,
        horizon: int,
        limits: tuple[float, float],
        period: float,
        step: float,
        damping: float,
    ) -> None:
        """Keep all; see the attributes."""
        self.model, self.guide, self.horizon = model, guide, horizon
        self.limits, self.period, self.step, self.damping = np.array(limits), period, step, damping

    def predicted(self, run: int, period: int) -> Rollout:
        """Return a run of the guide over the horizon from a control period on."""
        end = period + self.horizon
        return Rollout(self.guide.states[run, period : end + 1], self.guide.torques[run, period:end])

    def improve(self, prediction: Rollout, now: Instant) -> Rollout:
        """Return a better prediction, which begins at the present state; its first torque is what to apply.

        Args:
            prediction: from about the present state on. Shapes (horizon + 1, n), (horizon, 2).
            now: the present.
        """
        guide, last = self.guide, now.period + self.horizon
        end = np.concatenate([guide.states[now.run, last], guide.torques[now.run, last - 1]])
        slope, curvature = guide.slopes[now.run, last], guide.curvatures[now.run, last]
        off = np.concatenate([prediction.states[-1], prediction.torques[-1]]) - end
        found = self._sweep(prediction, now, CostToGo(slope + curvature @ off, curvature))
        runs = self._roll_out(prediction, now, found)
        finite = np.all(np.isfinite(runs.states), axis=(1, 2))
        if not finite.any():
            return self.predicted(now.run, now.period)
        states = np.where(finite[:, None, None], runs.states, prediction.states)
        off = np.concatenate([states[:, -1], runs.torques[:, -1]], axis=1) - end
        total = self._costs(states, runs.torques, now) + off @ slope + 0.5 * np.sum(off @ curvature * off, axis=1)
        best = int(np.argmin(np.where(finite, total, np.inf)))
        return Rollout(states[best], runs.torques[best])

    def shifted(self, prediction: Rollout, now: Instant) -> Rollout:
        """Return a prediction from the next instant on; the guide's feedback law appends a period."""
        guide, end = self.guide, now.period + self.horizon
        states, torques = prediction
        off = np.concatenate([states[-1] - guide.states[now.run, end], torques[-1] - guide.torques[now.run, end - 1]])
        torque = guide.torques[now.run, end] + guide.gains[now.run, end] @ off
        torque = np.clip(torque, -self.limits, self.limits)
        state = self.model.step(states[-1], torque, self.period, step=self.step, **now.quantities)
        return Rollout(np.concatenate([states[1:], state[None]]), np.concatenate([torques[1:], torque[None]]))

    def _residuals(self, at: Outputs, now: Instant) -> tuple[Floats, Floats]:
        """Return what costs something over the horizon, and the weights on its squares.

        Residuals are the tip's errors, and the links' deflections beyond their limit [m]. The cost of the end is in
        that of what follows.

        Args:
            at: outputs of states over the horizon. Shapes (..., horizon + 1, k).
            now: the present.

        Returns:
            Shape (..., horizon + 1, 4) each.
        """
        guide, horizon = self.guide, slice(now.period, now.period + self.horizon + 1)
        limit = guide.deflection_limit
        excess = at.deflection - np.clip(at.deflection, -limit, limit)
        weights = np.empty((*excess.shape[:-1], 4))
        weights[..., :2] = guide.tip_weights[horizon, None]
        weights[..., 2:] = guide.deflection_weight * (excess != 0.0)
        weights[..., -1, :] = 0.0
        return np.concatenate([at.true_tip - guide.reference[horizon], excess], axis=-1), weights

    def _sweep(self, prediction: Rollout, now: Instant, beyond: CostToGo) -> Sweep:
        """Sweep backward through the prediction."""
        states, torques = prediction
        moved = self.model.step_jacobians(states[:-1], torques, self.period, step=self.step, **now.quantities)
        outputs, slopes = self.model.output_jacobians(states)
        residuals, weights = self._residuals(outputs, now)
        by_state = np.concatenate([slopes.true_tip, slopes.deflection], axis=-2)
        gradient, hessian = np.empty(states.shape), np.empty((*states.shape, states.shape[1]))
        kernels.expand(residuals, by_state, weights, gradient, hessian)
        quadratic = Model(
            moved.by_state,
            moved.by_torque,
            gradient,
            hessian,
            self.guide.torque_weights,
            np.concatenate([now.before[None], torques]),
            defects=moved.state - states[1:],
        )
        lap = len(self.guide.reference) - 1 - self.horizon
        return sweep(quadratic, self.limits, 2.0 * self.damping / (lap * self.limits**2), beyond)

    def _roll_out(self, prediction: Rollout, now: Instant, found: Sweep) -> Rollout:
        """Run the model from the present state under the guide's feedback law, and under all steps of the sweep.

        A sweep through a prediction that is out of all bounds may overflow; it has no steps then.
        """
        guide, size = self.guide, 2 * self.model.size
        along = now.run, slice(now.period, now.period + self.horizon)
        first = guide.torques[now.run, now.period - 1] if now.period > 0 else np.zeros(2)
        laws = [self._law(guide.gains[along], self.predicted(now.run, now.period), first)]
        if np.all(np.isfinite(found.gains)) and np.all(np.isfinite(found.forward)):
            about = self._law(found.gains, prediction, now.before)
            laws += [about._replace(forward=about.forward + alpha * found.forward) for alpha in ALPHAS]
        forward, gains, references = (np.stack(part) for part in zip(*laws, strict=True))
        return self.model.rollout(
            now.state,
            forward,
            gains=gains[..., :size],
            references=references,
            torque_gains=gains[..., size:],
            torque_before=now.before,
            limits=(float(self.limits[0]), float(self.limits[1])),
            period=self.period,
            step=self.step,
            **now.quantities,
        )

    def _law(self, gains: Floats, about: Rollout, first: Floats) -> _Law:
        """Return the feedback law with gains on the deviation from a run; `first`: torque before the run's first."""
        before = np.concatenate([first[None], about.torques[:-1]])
        on_torque = gains[:, :, 2 * self.model.size :]
        forward = about.torques - (on_torque @ before[..., None])[..., 0]
        return _Law(forward, gains, about.states[:-1])

    def _costs(self, states: Floats, torques: Floats, now: Instant) -> Floats:
        """Return the cost of each run over the horizon. Shape (runs,)."""
        outputs, _ = self.model.output_jacobians(states)
        result = np.empty(len(states))
        kernels.costs(*self._residuals(outputs, now), torques, now.before, self.guide.torque_weights, result)
        return result
