"""`ContouringIteration`: `RealTimeIteration` of a race, with the progress along the plan as an input.

A prediction has, beside states and torques, the plan's instants, which grow by the *pace* in each control period. The
pace is an input like the torques. A period costs the square of the tip's distance from the plan's reference at its
instant, more beyond `ROOM`, and `price` less for each of the plan's periods that it gains. At the horizon's end the
deviation from the plan costs what it would cost from there on under the plan's feedback (the curvature of
`ReferenceRun`; not its slope, since the plan is optimal for the race and not for this distance).

Sources: Lam, Manzie and Good, *Model predictive contouring control*, CDC 2010; Liniger, Domahidi and Morari, Optimal
Control Applications and Methods 36, 2015 (racing); Diehl, Bock and Schloeder, SIAM J. Control Optim. 43, 2005.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np

from flexarm_baselines.arrays import Array, Floats, chosen_rows, is_sound, product
from flexarm_baselines.optimal.kernels import Model, Sweep
from flexarm_baselines.optimal.sweep import CostToGo, sweep
from flexarm_baselines.predictive.iteration import ALPHAS, Instant, RealTimeIteration
from flexarm_env.simulation.feedback import Rollout

ROOM = 0.1  # [m]; distance of the tip beyond which the square of the rest is added to the cost
STEEP = 30.0  # weight of that square, as a multiple of the weight on the squared distance
EVEN = 1e-3  # [m^2]; weight on the square of the pace's deviation from 1, as the tip's squared distance during a period
LEAST, MOST = 0.1, 2.0  # paces


class Prediction(NamedTuple):
    """Predictions of n arms over N control periods.

    Attributes:
        states: Shape (n, N + 1, s).
        torques: [N m]. Shape (n, N, 2).
        instants: of the plan, in control periods. Shape (n, N + 1).
    """

    states: Floats
    torques: Floats
    instants: Floats


class _Slopes(NamedTuple):
    """Changes of torques and paces, and their gains on y = (state, instant, torque before), by period."""

    torque: Floats  # Shape (n, N, 2)
    torque_gain: Floats  # Shape (n, N, 2, s + 3)
    pace: Floats  # Shape (n, N)
    pace_gain: Floats  # Shape (n, N, s + 3)


class ContouringIteration(RealTimeIteration):
    """`RealTimeIteration` with the pace as a third input, about a single reference run."""

    price: float  # [m^2]; worth of a period of progress: the tip's squared distance that costs as much in a period

    def contoured(self, prediction: Prediction, now: Instant) -> Prediction:
        """Return better predictions; see `RealTimeIteration.improve`.

        Each period of the backward sweep has two steps: the pace is chosen after the torques, which do not move the
        instant. Forward, candidates of several step lengths are rolled out; their instants are those of the linear
        model, which is exact but for the limits.
        """
        states, torques, instants = prediction
        moved = self.model.step_jacobians(
            states[:, :-1], torques, self.period, step=self.step, **{k: v[:, None] for k, v in now.quantities.items()}
        )
        count, periods, size = moved.state.shape
        by_state = np.zeros((count, periods, size + 1, size + 1))
        by_state[..., :size, :size], by_state[..., size, size] = moved.by_state, 1.0
        by_torque = np.concatenate([moved.by_torque, np.zeros((count, periods, 1, 2))], axis=2)
        defects = np.concatenate([moved.state - states[:, 1:], np.zeros((count, periods, 1))], axis=2)
        found = self._backward(Rollout(by_state, by_torque), defects, prediction, now)
        off, forward, later = np.zeros((count, size + 3)), found.torque.copy(), np.zeros_like(instants)
        off[:, :size] = now.state - states[:, 0]
        paces = np.diff(instants)
        for t in range(periods):
            forward[:, t] += found.torque_gain[:, t, :, size] * later[:, t, None]
            wanted = torques[:, t] + found.torque[:, t] + product(found.torque_gain[:, t], off)
            change = np.clip(wanted, -self.limits, self.limits) - torques[:, t]
            off[:, : size + 1] = product(by_state[:, t], off[:, : size + 1]) + product(by_torque[:, t], change)
            off[:, : size + 1] += defects[:, t]
            off[:, size + 1 :] = change
            pace = paces[:, t] + found.pace[:, t] + np.sum(found.pace_gain[:, t] * off, axis=1)
            later[:, t + 1] = later[:, t] + np.clip(pace, LEAST, MOST) - paces[:, t]
            off[:, size] = later[:, t + 1]
        gains, ahead = np.delete(found.torque_gain, size, axis=3), self._ahead(now)
        nothing = np.empty(0)
        law = Sweep(forward, gains, nothing, nothing, nothing)
        runs = self._roll_out(Rollout(states, torques), now, ahead, law)
        tried = instants[:, None] + np.array([0.0, *ALPHAS])[:, None] * later[:, None]
        tried[:, 0] = instants[:, :1] + np.arange(periods + 1.0)  # the reference run's law goes at the plan's pace
        sound = is_sound(runs.states, 2)
        candidates = Prediction(
            np.where(sound[..., None, None], runs.states, ahead.run.states[:, None]), runs.torques, tried
        )
        total = np.where(sound, self._total(candidates, now), np.inf)
        arms, best = np.arange(count), np.argmin(total, axis=1)
        chosen = Prediction(*(part[arms, best] for part in candidates))
        return chosen._replace(torques=chosen_rows(np.any(sound, axis=1), chosen.torques, ahead.run.torques))

    def place(self, instants: Floats) -> Array:
        """Return the plan's nearest control periods."""
        return np.clip(np.rint(instants), 0, len(self.runs.torques[0]) - self.horizon - 2).astype(np.int64)

    def along(self, table: Floats, instants: Floats) -> tuple[Floats, Floats]:
        """Interpolate a table of the plan's instants, and return its slopes, too. Shape (..., columns) each."""
        instants = instants.clip(0.0, len(table) - 1.0)
        low = np.minimum(instants, len(table) - 2).astype(np.int64)
        slope = table[low + 1] - table[low]
        return table[low] + (instants - low)[..., None] * slope, slope

    @cached_property
    def ends(self) -> Floats:
        """States of the plan and the torques before them, side by side. Shape (P + 1 + N, s + 2)."""
        before = np.concatenate([np.zeros((1, 2)), self.runs.torques[0, :-1]])
        return np.concatenate([self.runs.states[0], before], axis=1)

    def _squares(self, at: Prediction) -> list[tuple[float, Floats, Floats]]:
        """Return weights, the residuals whose squares instants cost, and their derivatives by (state, instant)."""
        weight, (bent, limit) = self.runs.tip_weights[0], self._deflection_cost
        outputs, by = self.model.output_jacobians(at.states)
        reference, slope = self.along(self.runs.reference, at.instants)
        off, by_off = outputs.true_tip - reference, np.concatenate([by.true_tip, -slope[..., None]], axis=-1)
        distance = np.linalg.norm(off, axis=-1, keepdims=True)
        by_distance = (off / np.maximum(distance, 1e-9))[..., None, :] @ by_off
        far, bend = np.maximum(distance - ROOM, 0.0), outputs.deflection - outputs.deflection.clip(-limit, limit)
        by_bend = np.concatenate([by.deflection, np.zeros((*bend.shape, 1))], axis=-1)
        return [
            (weight, off, by_off),
            (weight * STEEP, far, by_distance * (far > 0.0)[..., None]),
            (bent, bend, by_bend * (bend != 0.0)[..., None]),
        ]

    def _total(self, runs: Prediction, now: Instant) -> Floats:
        """Return the cost of candidates. Shape (n, candidates)."""
        weight, weights, paces = self.runs.tip_weights[0], self.runs.torque_weights, np.diff(runs.instants)
        total = weight * np.sum(EVEN * (paces - 1.0) ** 2 - self.price * paces, axis=-1)
        for each, residuals, _ in self._squares(runs):
            total += each * np.sum(residuals[..., :-1, :] ** 2, axis=(-1, -2))  # the end's are in what follows
        before = np.broadcast_to(now.before[:, None, None], runs.torques[..., :1, :].shape)
        change = np.diff(np.concatenate([before, runs.torques], axis=2), axis=2)
        total += np.sum(weights[0] * runs.torques**2 + weights[1] * change**2, axis=(-1, -2))
        off, _ = self._off(runs)
        curvature = self.runs.curvatures[0, self.place(runs.instants[..., -1])]
        return np.asarray(total + 0.5 * np.sum(product(curvature, off) * off, axis=-1))

    def _off(self, at: Prediction) -> tuple[Floats, Floats]:
        """Return by how much predictions end off the plan, and the plan's slope. Shape (..., s + 2) each."""
        plan, slope = self.along(self.ends, at.instants[..., -1])
        return np.concatenate([at.states[..., -1, :], at.torques[..., -1, :]], axis=-1) - plan, slope

    def _beyond(self, prediction: Prediction) -> CostToGo:
        """Return the cost of what follows the horizon by (state, instant, torque before) there."""
        (off, slope), size = self._off(prediction), prediction.states.shape[-1]
        by_off = np.insert(np.tile(np.eye(size + 2), (len(off), 1, 1)), size, -slope, axis=2)
        weighed = by_off.swapaxes(-1, -2) @ self.runs.curvatures[0, self.place(prediction.instants[:, -1])]
        return CostToGo(product(weighed, off), weighed @ by_off)

    def _backward(self, moved: Rollout, defects: Floats, prediction: Prediction, now: Instant) -> _Slopes:
        """Sweep backward; `moved` has the derivatives of each period's end by (state, instant) and by torques."""
        weight, ahead = self.runs.tip_weights[0], self._beyond(prediction)
        squares = self._squares(prediction)
        gradient: Floats = np.add.reduce([2.0 * each * (r[..., None, :] @ by)[..., 0, :] for each, r, by in squares])
        hessian: Floats = np.add.reduce([2.0 * each * by.swapaxes(-1, -2) @ by for each, _, by in squares])
        torques = np.concatenate([now.before[:, None], prediction.torques], axis=1)
        paces = np.diff(prediction.instants)
        count, periods, size = gradient.shape[0], paces.shape[1], gradient.shape[2] - 1
        at = size  # of the instant
        gradient[:, -1], hessian[:, -1] = 0.0, 0.0  # in what follows
        found = _Slopes(*(np.empty((count, periods, *shape)) for shape in ((2,), (2, size + 3), (), (size + 3,))))
        for t in range(periods - 1, -1, -1):
            slopes, curvatures = ahead
            bends = curvatures[:, at, at].clip(0.0) + 2.0 * weight * EVEN
            slope = slopes[:, at] + weight * (2.0 * EVEN * (paces[:, t] - 1.0) - self.price)
            free = -slope / bends
            change = free.clip(LEAST - paces[:, t], MOST - paces[:, t])
            gain = np.where((change == free)[:, None], -curvatures[:, at] / bends[:, None], 0.0)
            found.pace[:, t], found.pace_gain[:, t] = change, gain
            slopes = slopes + gain * (slope + bends * change)[:, None] + curvatures[:, at] * change[:, None]
            crossed = gain[:, :, None] * curvatures[:, None, at]
            curvatures = curvatures + crossed + crossed.swapaxes(1, 2)
            curvatures += bends[:, None, None] * gain[:, :, None] * gain[:, None]
            now_and_end = [t, -1]
            quadratic = Model(
                moved.states[:, t : t + 1],
                moved.torques[:, t : t + 1],
                gradient[:, now_and_end],
                hessian[:, now_and_end],
                self.runs.torque_weights,
                torques[:, t : t + 2],
                defects=defects[:, t : t + 1],
            )
            one = sweep(quadratic, self.limits, None, CostToGo(slopes, curvatures))
            found.torque[:, t], found.torque_gain[:, t] = one.forward[:, 0], one.gains[:, 0]
            ahead = CostToGo(one.slopes[:, 0], one.curvatures[:, 0])
        return found
