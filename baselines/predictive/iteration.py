"""One iteration of optimisation in each control period, from the prediction of the period before.

The horizon moves by a period each time, and the prediction with it, so that a single iteration keeps it near its
optimum (real-time iteration: Diehl, Bock and Schloeder, *A real-time iteration scheme for nonlinear optimization in
optimal feedback control*, SIAM J. Control and Optimization 43, 2005). An iteration is one of `optimal.solver`: exact
Jacobians, a backward sweep with box constraints (Tassa, Mansard and Todorov, ICRA 2014), and a roll-out from the
present state under ``clip(u + alpha k + K (z - z0))`` for several alpha side by side. The cost of what follows the
horizon is that along the reference run, to second order. The reference run's own feedback law is tried beside the
steps, so that a prediction that went astray is left at once.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexarm_baselines.arrays import Array, Floats, chosen_rows, is_sound, product
from flexarm_baselines.optimal.kernels import Model, Sweep
from flexarm_baselines.optimal.solver import STEP_LENGTHS
from flexarm_baselines.optimal.sweep import CostToGo, sweep
from flexarm_baselines.predictive import kernels
from flexarm_baselines.predictive.reference_run import ReferenceRun
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.feedback import Rollout

ALPHAS = STEP_LENGTHS[:-1]  # with the reference run's law they fill the lanes of a roll-out


class Instant(NamedTuple):
    """Where n arms are, each at an instant of its own.

    Attributes:
        run: places of their runs in `ReferenceRun`. Shape (n,).
        period: control periods of the lap that begin. Shape (n,).
        state: s entries each. Shape (n, s).
        before: torques of the periods that end [N m]. Shape (n, 2).
        quantities: of the arms, by name as `FlexibleArm.step` takes them. Shape (n,) each.
    """

    run: Array
    period: Array
    state: Floats
    before: Floats
    quantities: dict[str, Floats]


class _Ahead(NamedTuple):
    """What the reference run says of the horizons of n arms, each of N periods.

    Attributes:
        run: states and torques of the reference run. Shapes (n, N + 1, s), (n, N, 2).
        gains: its feedback, see `ReferenceRun`. Shape (n, N, 2, s + 2).
        first: torque of the reference run before the first period [N m]. Shape (n, 2).
        reference: where the tip should be [m]. Shape (n, N + 1, 2).
        tip_weights: Shape (n, N + 1).
        beyond: the cost of what follows, in the deviation from the reference run's end. Shapes (n, s + 2),
            (n, s + 2, s + 2).
    """

    run: Rollout
    gains: Floats
    first: Floats
    reference: Floats
    tip_weights: Floats
    beyond: CostToGo


class _Law(NamedTuple):
    """Feedback laws of n arms about runs of N periods.

    Attributes:
        change: of the torques, to be taken by several lengths. Shape (n, N, 2).
        gains: on the deviation of state and torque before. Shape (n, N, 2, s + 2).
        states: of the runs. Shape (n, N + 1, s).
        torques: of the runs [N m]. Shape (n, N, 2).
        first: of the period before the runs' first [N m]. Shape (n, 2).
    """

    change: Floats
    gains: Floats
    states: Floats
    torques: Floats
    first: Floats

    @property
    def offset(self) -> Floats:
        """Torques less what the gains make of the runs' own torques before [N m]. Shape (n, N, 2)."""
        before = np.concatenate([self.first[:, None], self.torques[:, :-1]], axis=1)
        return self.torques - product(self.gains[..., self.states.shape[-1] :], before)


class RealTimeIteration:
    """Improves predictions of arms of one kind; what it finds for an arm does not depend on the others.

    Attributes:
        model: the arm.
        runs: reference runs, about which the predictions begin.
        horizon: control periods, N.
        limits: largest torques [N m]. Shape (2,).
        period: control period [s].
        damping: regularisation of the sweep, in units of a weight on changes of the torques [m^2].
        step: integration step [s].
    """

    def __init__(
        self,
        model: FlexibleArm,
        runs: ReferenceRun,
        horizon: int,
        limits: tuple[float, float],
        period: float,
        step: float,
        damping: float,
    ) -> None:
        """Keep all; see the attributes."""
        self.model, self.runs, self.horizon = model, runs, horizon
        self.limits, self.period, self.step, self.damping = np.array(limits), period, step, damping
        self._deflection_cost = float(runs.deflection_weight), float(runs.deflection_limit)

    def predicted(self, run: Array, period: Array) -> Rollout:
        """Return reference runs over the horizon from control periods on.

        Args:
            run: places of the runs in `ReferenceRun`. Shape (n,).
            period: Shape (n,).
        """
        instants = period[:, None] + np.arange(self.horizon + 1)
        return Rollout(self.runs.states[run[:, None], instants], self.runs.torques[run[:, None], instants[:, :-1]])

    def improve(self, prediction: Rollout, now: Instant) -> Rollout:
        """Return better predictions, which begin at the present states; their first torques are what to apply.

        Args:
            prediction: from about the present states on. Shapes (n, N + 1, s), (n, N, 2).
            now: the present.
        """
        ahead = self._ahead(now)
        slopes, curvatures = ahead.beyond
        off = _end(prediction) - _end(ahead.run)
        beyond = CostToGo(slopes + product(curvatures, off), curvatures)
        runs = self._roll_out(prediction, now, ahead, self._sweep(prediction, now, ahead, beyond))
        sound = is_sound(runs.states, 2)
        states = np.where(sound[..., None, None], runs.states, ahead.run.states[:, None])
        off = _end(Rollout(states, runs.torques)) - _end(ahead.run)[:, None]
        total = self._costs(states, runs.torques, now, ahead) + (off @ slopes[..., None])[..., 0]
        total += 0.5 * np.sum(off @ curvatures * off, axis=2)
        arms, best = np.arange(len(total)), np.argmin(np.where(sound, total, np.inf), axis=1)
        torques = chosen_rows(np.any(sound, axis=1), runs.torques[arms, best], ahead.run.torques)
        return Rollout(states[arms, best], torques)

    def shifted(self, prediction: Rollout, now: Instant) -> Rollout:
        """Return predictions from the next instant on; the reference run's feedback law appends a period."""
        runs, last = self.runs, now.period + self.horizon
        states, torques = prediction
        off = _end(prediction) - np.concatenate([runs.states[now.run, last], runs.torques[now.run, last - 1]], axis=1)
        torque = runs.torques[now.run, last] + product(runs.gains[now.run, last], off)
        torque = np.clip(torque, -self.limits, self.limits)
        state = self.model.step(states[:, -1], torque, self.period, step=self.step, **now.quantities)
        state = chosen_rows(is_sound(state), state, runs.states[now.run, last + 1])
        return Rollout(
            np.concatenate([states[:, 1:], state[:, None]], axis=1),
            np.concatenate([torques[:, 1:], torque[:, None]], axis=1),
        )

    # --- inside -----------------------------------------------------------------------------------------------------

    def _ahead(self, now: Instant) -> _Ahead:
        """Look up what the reference run says of the horizons."""
        runs, last = self.runs, now.period + self.horizon
        instants = now.period[:, None] + np.arange(self.horizon + 1)
        first = np.where(now.period[:, None] > 0, runs.torques[now.run, np.maximum(now.period, 1) - 1], 0.0)
        return _Ahead(
            self.predicted(now.run, now.period),
            runs.gains[now.run[:, None], instants[:, :-1]],
            first,
            runs.reference[instants],
            runs.tip_weights[instants],
            CostToGo(runs.slopes[now.run, last], runs.curvatures[now.run, last]),
        )

    def _sweep(self, prediction: Rollout, now: Instant, ahead: _Ahead, beyond: CostToGo) -> Sweep:
        states, torques = prediction
        of_periods = {name: value[:, None] for name, value in now.quantities.items()}
        moved = self.model.step_jacobians(states[:, :-1], torques, self.period, step=self.step, **of_periods)
        at, slopes = self.model.output_jacobians(states)
        gradient, hessian = np.empty(states.shape), np.empty((*states.shape, states.shape[-1]))
        kernels.expand(
            at.true_tip,
            slopes.true_tip,
            at.deflection,
            slopes.deflection,
            kernels.Wanted(ahead.reference, ahead.tip_weights, *self._deflection_cost),
            gradient,
            hessian,
        )
        quadratic = Model(
            moved.by_state,
            moved.by_torque,
            gradient,
            hessian,
            self.runs.torque_weights,
            np.concatenate([now.before[:, None], torques], axis=1),
            defects=moved.state - states[:, 1:],
        )
        lap = len(self.runs.reference) - 1 - self.horizon
        with np.errstate(over="ignore", invalid="ignore"):  # a prediction that is out of all bounds
            return sweep(quadratic, self.limits, 2.0 * self.damping / (lap * self.limits**2), beyond)

    def _roll_out(self, prediction: Rollout, now: Instant, ahead: _Ahead, found: Sweep) -> Rollout:
        """Run the model from the present states under the reference run's law, and under all steps of the sweep.

        A sweep through a prediction that is out of all bounds may overflow; the reference run's law then takes the
        place of its steps.
        """
        reference_law = _Law(np.zeros_like(found.forward), ahead.gains, *ahead.run, ahead.first)
        steps = _Law(found.forward, found.gains, *prediction, now.before)
        sound = is_sound(found.gains) & is_sound(found.forward)
        if not sound.all():
            chosen = (chosen_rows(sound, one, other) for one, other in zip(steps, reference_law, strict=True))
            steps = _Law(*chosen)
        size, candidates = 2 * self.model.size, (len(sound), 1 + len(ALPHAS), self.horizon)
        forward, references = np.empty((*candidates, 2)), np.empty((*candidates, size))
        gains, torque_gains = np.empty((*candidates, 2, size)), np.empty((*candidates, 2, 2))
        for law, lanes, lengths in ((reference_law, slice(0, 1), np.zeros(1)), (steps, slice(1, None), ALPHAS)):
            forward[:, lanes] = law.offset[:, None] + lengths[:, None, None] * law.change[:, None]
            references[:, lanes] = law.states[:, None, :-1]
            gains[:, lanes] = law.gains[:, None, ..., :size]
            torque_gains[:, lanes] = law.gains[:, None, ..., size:]
        return self.model.rollout(
            now.state[:, None],
            forward,
            gains=gains,
            references=references,
            torque_gains=torque_gains,
            torque_before=now.before[:, None],
            limits=(float(self.limits[0]), float(self.limits[1])),
            period=self.period,
            step=self.step,
            **{name: value[:, None] for name, value in now.quantities.items()},
        )

    def _costs(self, states: Floats, torques: Floats, now: Instant, ahead: _Ahead) -> Floats:
        """Return the cost of each candidate over the horizon. Shape (n, candidates)."""
        at, _ = self.model.output_jacobians(states)
        result = np.empty(states.shape[:2])
        wanted = kernels.Wanted(ahead.reference, ahead.tip_weights, *self._deflection_cost)
        kernels.costs(at.true_tip, at.deflection, wanted, torques, now.before, self.runs.torque_weights, result)
        return result


def _end(run: Rollout) -> Floats:
    """Return the last state of runs, and the torque before it. Shape (..., s + 2)."""
    return np.concatenate([run.states[..., -1, :], run.torques[..., -1, :]], axis=-1)
