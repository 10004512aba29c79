"""`RaceMPCC`: model predictive contouring control, whose third input is the progress along a plan.

Sources: Lam, Manzie and Good, *Model predictive contouring control*, CDC 2010; Liniger, Domahidi and Morari,
*Optimization-based autonomous racing of 1:43 scale RC cars*, Optimal Control Applications and Methods 36, 2015; Diehl,
Bock and Schloeder, SIAM J. Control and Optimization 43, 2005 (one step of Gauss and Newton a period, by multiple
shooting).
"""

from __future__ import annotations

from typing import Any, ClassVar, Self

import numpy as np

from flexarm_baselines.arrays import Array, Floats, chosen_rows, is_sound, product
from flexarm_baselines.controller import Memory, Seen
from flexarm_baselines.lqg.race import RaceLQG, race_plan
from flexarm_baselines.observers import SENSORS
from flexarm_baselines.optimal.kernels import Model
from flexarm_baselines.optimal.plan import Plan
from flexarm_baselines.optimal.sweep import CostToGo, sweep
from flexarm_baselines.policy import env_attribute
from flexarm_baselines.predictive.controller import NMPC
from flexarm_baselines.predictive.iteration import ALPHAS, Instant
from flexarm_env.simulation.feedback import Rollout
from flexarm_baselines.optimal.kernels import Sweep

ROOM, STEEP = 0.1, 30.0
PRICE = 0.01
LEAST, MOST = 0.1, 2.0
PULL = 1e-3


class _Placed(Seen):
    instants: Floats


class RaceMPCC(NMPC):
    blocks: ClassVar[tuple[str, ...]] = SENSORS

    def __init__(self, task: Any, plans: Any, price: float = PRICE, room: float = ROOM, steep: float = STEEP, scale: float = 1.0, trust=1.0, **design: Any) -> None:
        super().__init__(task, plans=plans, **design)
        self.price, self.room, self.steep, self.trust = price, room, steep, trust
        runs = self.iteration.runs
        joints, modes = 2, self.iteration.model.size - 2
        factor = np.concatenate([np.ones(2), np.full(modes, scale**2), np.full(2, scale), np.full(modes, scale**3)])
        self.table = np.concatenate([runs.states[0] * factor, runs.torques[0] * scale**2], axis=1)  # (P+1+N, 18)
        self.last = len(self.plans[0].states) - 1

    @classmethod
    def options(cls) -> dict[str, Any]:
        return super().options() | {"action_mode": "race", "start": "corner"}

    @classmethod
    def for_env(cls, env: Any, plan: Plan | str = "default", **design: Any) -> Self:
        plan = race_plan(plan) if isinstance(plan, str) else plan
        found: Self = RaceLQG.for_env.__func__(cls, env, plan, **design)
        settings = env_attribute(env, "settings")
        found.ways = np.asarray(plan.notes["ways"])
        found.path = settings.paths[0]
        found.speed, found.change = settings.reference_speed, settings.reference_acceleration * plan.period
        return found

    def period_of(self, seen: Seen) -> Array:
        if not isinstance(seen, _Placed):
            return np.zeros(len(seen), dtype=np.int64)
        return np.minimum(np.rint(seen.instants), self.last).astype(np.int64)

    def start(self, seen: Seen) -> Memory:
        run = np.zeros(len(seen), dtype=np.int64)
        states, torques = self.iteration.predicted(run, run)
        n = len(seen)
        taus = np.tile(np.arange(self.iteration.horizon + 1.0), (n, 1))
        state = self.resting(seen, run)
        return (np.zeros(n), np.zeros(n), np.zeros((n, 2)), states, torques, taus, *self.begin(seen, state))

    def torque(self, seen: Seen, memory: Memory) -> tuple[Floats, Memory]:
        way, speed, before, states, torques, taus, *belief = memory
        placed = _Placed(seen.task, seen.observations)
        placed.instants = taus[:, 0]
        run = np.zeros(len(seen), dtype=np.int64)
        believed, quantities, after = self.update(placed, tuple(belief), run)
        believed = chosen_rows(is_sound(believed), believed, states[:, 0])
        for _ in range(self.iterations):
            states, torques, taus = self.improve(states, torques, taus, believed, before, quantities)
        torque, instant = torques[:, 0].copy(), taus[:, 1]
        P = self.task.period
        beyond = np.maximum(instant - (len(self.ways) - 1), 0.0) * (self.ways[-1] - self.ways[-2])
        wanted = np.interp(instant, np.arange(len(self.ways)), self.ways) + beyond
        share = ((wanted - way) / (P * self.speed)).clip(0.0, 1.0).astype(np.float32)
        speed = np.clip(share * self.speed, speed - self.change, speed + self.change)
        # shift
        own = {k: v for k, v in quantities.items()}
        k = self._place(taus[:, -1])
        end = np.concatenate([states[:, -1], torques[:, -1]], axis=1) - self.table[k]
        last = np.clip(self.table[k + 1, 16:] + product(self.iteration.runs.gains[0, k], end), -self.iteration.limits, self.iteration.limits)
        new = self.iteration.model.step(states[:, -1], last, P, step=self.iteration.step, **own)
        states = np.concatenate([states[:, 1:], new[:, None]], axis=1)
        torques = np.concatenate([torques[:, 1:], last[:, None]], axis=1)
        pace = (taus[:, -1] - taus[:, -2])
        taus = np.concatenate([taus[:, 1:], (taus[:, -1] + pace)[:, None]], axis=1)
        return np.column_stack([torque, share]), (way + P * speed, speed, torque, states, torques, taus, *self.advance(after, torque))

    def action(self, seen: Seen, torque: Floats) -> Floats:
        return np.column_stack([super().action(seen, torque[:, :2]), torque[:, 2]])

    def _place(self, taus):
        return np.clip(np.rint(taus), 0, self.last).astype(np.int64)

    def _at(self, table, taus):
        """Interpolate a table at instants; return it and its slope"""
        low = np.clip(np.floor(taus), 0, self.last - 1).astype(np.int64)
        slope = table[low + 1] - table[low]
        share = np.clip(taus, 0, self.last) - low
        return table[low] + share[..., None] * slope, slope

    def improve(self, states, torques, taus, believed, before, quantities):
        it, runs = self.iteration, self.iteration.runs
        count, N = torques.shape[:2]
        size = states.shape[2]
        moved = it.model.step_jacobians(states[:, :-1], torques, it.period, step=it.step, **{k: v[:, None] for k, v in quantities.items()})
        at, by = it.model.output_jacobians(states)
        reference, slope = self._at(runs.reference, taus)
        W = runs.tip_weights[0]
        J = np.concatenate([by.true_tip, -slope[..., None]], axis=-1)  # n,N+1,2,17
        off = at.true_tip - reference
        gradient = 2 * W * np.einsum("nti,ntij->ntj", off, J)
        hessian = 2 * W * J.swapaxes(-1, -2) @ J
        distance = np.linalg.norm(off, axis=-1)
        r = np.maximum(distance - self.room, 0.0)
        normal = np.einsum("nti,ntij->ntj", off / np.maximum(distance, 1e-9)[..., None], J)
        gradient += 2 * W * self.steep * r[..., None] * normal
        hessian += 2 * W * self.steep * (r > 0)[..., None, None] * normal[..., None] * normal[..., None, :]
        # deflection
        lim, dw = float(runs.deflection_limit), float(runs.deflection_weight)
        d = at.deflection
        over = d - np.clip(d, -lim, lim)
        D = np.concatenate([by.deflection, np.zeros((*by.deflection.shape[:-1], 1))], axis=-1)
        gradient += 2 * dw * np.einsum("nti,ntij->ntj", over, D)
        hessian += 2 * dw * np.einsum("nti,ntij,ntik->ntjk", (over != 0).astype(float), D, D)
        # terminal
        X, Xs = self._at(self.table, taus[:, -1])
        e = np.concatenate([states[:, -1], torques[:, -1]], axis=1) - X
        k = self._place(taus[:, -1])
        Pm, s = runs.curvatures[0, k] * self.trust, runs.slopes[0, k] * 0
        order = [*range(size), size + 2, size, size + 1]  # z = x, tau, p  from (x,p,tau)
        E = np.concatenate([np.broadcast_to(np.eye(size + 2), (count, size + 2, size + 2)), -Xs[..., None]], axis=2)
        E = E[:, :, order]
        v = np.einsum("nij,ni->nj", E, product(Pm, e) + s)
        V = E.swapaxes(-1, -2) @ Pm @ E
        v[:, :size + 1] += gradient[:, -1]; V[:, :size + 1, :size + 1] += hessian[:, -1]
        rho = self.price * W
        paces = np.diff(taus, axis=1)
        A = np.zeros((count, N, size + 1, size + 1)); A[..., :size, :size] = moved.by_state; A[..., size, size] = 1
        B = np.concatenate([moved.by_torque, np.zeros((count, N, 1, 2))], axis=2)
        defects = np.concatenate([moved.state - states[:, 1:], np.zeros((count, N, 1))], axis=2)
        ps = np.concatenate([before[:, None], torques], axis=1)
        kw, Kw, ku, Ku = np.empty((N, count)), np.empty((N, count, size + 3)), np.empty((N, count, 2)), np.empty((N, count, 2, size + 3))
        zg, zh = np.zeros((count, 1, size + 1)), np.zeros((count, 1, size + 1, size + 1))
        reg = PULL * W
        for t in range(N - 1, -1, -1):
            T = size
            q, h = v[:, T] - rho + 2 * reg * (paces[:, t] - 1.0), V[:, T, T] + 2 * reg
            h = np.maximum(h, 2 * reg)
            step = np.clip(-q / h, LEAST - paces[:, t], MOST - paces[:, t])
            free = step == -q / h
            gain = np.where(free[:, None], -V[:, T] / h[:, None], 0.0)
            kw[t], Kw[t] = step, gain
            v = v + gain * (q + h * step)[:, None] + V[:, :, T] * step[:, None]
            V = V + gain[:, :, None] * (h[:, None] * gain)[:, None] + gain[:, :, None] * V[:, None, T] + V[:, :, T, None] * gain[:, None]
            model = Model(A[:, t:t + 1], B[:, t:t + 1], np.concatenate([gradient[:, t:t + 1], zg], axis=1), np.concatenate([hessian[:, t:t + 1], zh], axis=1), runs.torque_weights, ps[:, t:t + 2], defects=defects[:, t:t + 1])
            found = sweep(model, it.limits, None, CostToGo(v, V))
            v, V = found.slopes[:, 0], found.curvatures[:, 0]
            ku[t], Ku[t] = found.forward[:, 0], found.gains[:, 0]
        z = np.zeros((count, size + 3)); z[:, :size] = believed - states[:, 0]
        forward, dt = ku.swapaxes(0, 1).copy(), np.zeros_like(taus)
        for t in range(N):
            forward[:, t] += Ku[t][..., size] * z[:, size, None]
            u = np.clip(torques[:, t] + ku[t] + product(Ku[t], z), -it.limits, it.limits)
            du = u - torques[:, t]
            x1 = product(A[:, t], z[:, :size + 1]) + product(B[:, t], du) + defects[:, t]
            z = np.concatenate([x1, du], axis=1)
            w = np.clip(paces[:, t] + kw[t] + np.sum(Kw[t] * z, axis=1), LEAST, MOST)
            z[:, size] += w - paces[:, t]
            dt[:, t + 1] = z[:, size]
        gains = np.delete(Ku.swapaxes(0, 1), size, axis=3)
        k0 = np.minimum(self._place(taus[:, 0]), self.last)
        now = Instant(np.zeros(count, dtype=np.int64), k0, believed, before, quantities)
        ahead = it._ahead(now)
        runs_ = it._roll_out(Rollout(states, torques), now, ahead, Sweep(forward, gains, v, V, v))
        sound = is_sound(runs_.states, 2)
        lengths = np.array([0.0, *ALPHAS])
        cand = taus[:, None] + lengths[:, None] * dt[:, None]
        cand[:, 0] = taus[:, :1] + np.arange(N + 1.0)
        cs = np.where(sound[..., None, None], runs_.states, ahead.run.states[:, None])
        cost = self.cost(cs, runs_.torques, cand, before)
        best = np.argmin(np.where(sound, cost, np.inf), axis=1)
        arms = np.arange(count)
        self.chosen = best
        return cs[arms, best], chosen_rows(np.any(sound, axis=1), runs_.torques[arms, best], ahead.run.torques), cand[arms, best]

    def cost(self, states, torques, taus, before):
        it, runs = self.iteration, self.iteration.runs
        at, _ = it.model.output_jacobians(states)
        reference, _ = self._at(runs.reference, taus)
        W = runs.tip_weights[0]
        dist = np.linalg.norm(at.true_tip - reference, axis=-1)
        lim, dw = float(runs.deflection_limit), float(runs.deflection_weight)
        over = at.deflection - np.clip(at.deflection, -lim, lim)
        total = W * np.sum(dist**2 + self.steep * np.maximum(dist - self.room, 0.0)**2, axis=-1) + dw * np.sum(over**2, axis=(-1, -2))
        b = np.broadcast_to(before[:, None, None], (*torques.shape[:2], 1, 2))
        du = np.diff(np.concatenate([b, torques], axis=2), axis=2)
        total += np.sum(runs.torque_weights[0] * torques**2 + runs.torque_weights[1] * du**2, axis=(-1, -2))
        paces = np.diff(taus, axis=-1)
        total += W * np.sum(PULL * (paces - 1)**2 - self.price * paces, axis=-1)
        X, _ = self._at(self.table, taus[..., -1])
        e = np.concatenate([states[..., -1, :], torques[..., -1, :]], axis=-1) - X
        P = runs.curvatures[0, self._place(taus[..., -1])] * self.trust
        return total + 0.5 * np.einsum("nci,ncij,ncj->nc", e, P, e)
