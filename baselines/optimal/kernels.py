"""Compiled sweeps of differential dynamic programming: backward through runs, box-constrained.

A sweep allocates a few small arrays once, none for each period. The state of the recursion is z = (x, p), the arm's
state and the torque of the period before, so that a weight on the change of the torque is a cost like the others.
Shapes: n entries of x, N periods; z has n + 2 entries. The functions call nothing outside this file (`kept_on_disk`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_env.codegen.cache import kept_on_disk

compiled = kept_on_disk(__file__, "sweeps of differential dynamic programming")
TORQUES = 2
LEAST_SHARE = 1e-14  # of the least curvature by the torques in the one of largest magnitude; rounding takes some 1e-16


class Model(NamedTuple):
    """Runs of N periods with their dynamics to first order and their cost to second order.

    Leading axes, of any number, are those of the runs; the kernels take one, R.

    Attributes:
        by_state: derivatives A of each period's end by the state. Shape (..., N, n, n).
        by_torque: B, by the torque. Shape (..., N, n, 2).
        gradient: of the cost, by each state. Shape (..., N + 1, n).
        hessian: Shape (..., N + 1, n, n).
        weights: on squared torques, and on their squared changes, of all runs. Shape (2, 2).
        torques: of the period before the first, then of each. Shape (..., N + 1, 2).
        defects: by how much each period ends beyond the next state; None: the runs follow the dynamics.
            Shape (..., N, n), or (..., 1, n) for all periods.
        curvature: of the dynamics, second derivatives of each period's end by state and torque in the direction of
            the cost's slope there; None: 0, as in iterative LQR. Shape (..., N, n + 2, n + 2), or
            (..., 1, n + 2, n + 2) for all periods.
    """

    by_state: Floats
    by_torque: Floats
    gradient: Floats
    hessian: Floats
    weights: Floats
    torques: Floats
    defects: Any = None
    curvature: Any = None


class Bounds(NamedTuple):
    """What keeps steps small.

    Attributes:
        limits: largest magnitudes of the torques. Shape (2,).
        regularisation: added to the curvature by each torque. Shape (2,).
    """

    limits: Floats
    regularisation: Floats


class Sweep(NamedTuple):
    """What a sweep finds; leading axes as those of `Model`.

    Attributes:
        forward: changes of the torques. Shape (..., N, 2).
        gains: on z. Shape (..., N, 2, n + 2).
        slopes: of the cost from each instant on, by z; the last one is that of a cost beyond the end, to which the
            end's own is added. Shape (..., N + 1, n + 2).
        curvatures: as `slopes`. Shape (..., N + 1, n + 2, n + 2).
        expected: first- and second-order part of the change of the cost that the model expects of the full step.
            Shape (..., 2).
    """

    forward: Floats
    gains: Floats
    slopes: Floats
    curvatures: Floats
    expected: Floats


class Period(NamedTuple):
    """What `Model` has of one period of a run.

    Attributes:
        a: A. Shape (n, n).
        b: B. Shape (n, 2).
        gradient: Shape (n,).
        hessian: Shape (n, n).
        curvature: Shape (n + 2, n + 2).
    """

    a: Floats
    b: Floats
    gradient: Floats
    hessian: Floats
    curvature: Floats


class Quadratic(NamedTuple):
    """The cost from a period on as a function of its z and its torque u, to second order.

    Attributes:
        z: slope by z. Shape (n + 2,).
        zz: curvature by z, its upper triangle. Shape (n + 2, n + 2).
        u: slope by u. Shape (2,).
        uu: curvature by u. Shape (2, 2).
        uz: curvature by u and z. Shape (2, n + 2).
    """

    z: Floats
    zz: Floats
    u: Floats
    uu: Floats
    uz: Floats


@compiled
def box_minimum(h11: float, h12: float, h22: float, q1: float, q2: float, box: Floats, step: Floats) -> None:
    """Minimise ``q k + k H k / 2`` over a rectangle; H is positive definite.

    The free minimum is taken where it lies within. Otherwise the minimum is on the edge: the least of the four edges'
    own minima.

    Args:
        h11: H.
        h12: H.
        h22: H.
        q1: q.
        q2: q.
        box: rows lower and upper bounds. Shape (2, 2).
        step: receives k. Shape (2,).
    """
    determinant = h11 * h22 - h12 * h12
    first = (h12 * q2 - h22 * q1) / determinant
    second = (h12 * q1 - h11 * q2) / determinant
    if box[0, 0] <= first <= box[1, 0] and box[0, 1] <= second <= box[1, 1]:
        step[0], step[1] = first, second
        return
    least = np.inf
    for side in range(2):
        first = box[side, 0]
        second = min(max(-(q2 + h12 * first) / h22, box[0, 1]), box[1, 1])
        value = q1 * first + q2 * second + 0.5 * (h11 * first * first + h22 * second * second) + h12 * first * second
        if value < least:
            least = value
            step[0], step[1] = first, second
        second = box[side, 1]
        first = min(max(-(q1 + h12 * second) / h11, box[0, 0]), box[1, 0])
        value = q1 * first + q2 * second + 0.5 * (h11 * first * first + h22 * second * second) + h12 * first * second
        if value < least:
            least = value
            step[0], step[1] = first, second


@compiled
def state_model(period: Period, vx: Floats, vxx: Floats, va: Floats, q: Quadratic) -> None:
    """Differentiate a period's cost and what follows by the arm's state x, whatever the torque.

    Args:
        period: the period.
        vx: slope of the cost of what follows by the next z. Shape (n + 2,).
        vxx: its curvature. Shape (n + 2, n + 2).
        va: receives the part of vxx by the states, times A. Shape (n, n).
        q: receives `z` in its first n entries, and `zz` in its first n rows; 0 beyond column n.
    """
    a, _, gradient, hessian, curvature = period
    n = a.shape[0]
    for i in range(n):
        for j in range(n):
            va[i, j] = 0.0
        for m in range(n):
            factor = vxx[i, m]
            for j in range(n):
                va[i, j] += factor * a[m, j]
    for i in range(n):
        q.z[i] = gradient[i]
        for j in range(n + TORQUES):
            q.zz[i, j] = hessian[i, j] + curvature[i, j] if j < n else 0.0
        for m in range(n):
            factor = a[m, i]
            q.z[i] += factor * vx[m]
            for j in range(i, n):
                q.zz[i, j] += factor * va[m, j]


@compiled
def torque_model(period: Period, vx: Floats, vxx: Floats, va: Floats, q: Quadratic) -> None:
    """Differentiate what follows a period by its torque, without the torque's own cost; arguments of `state_model`.

    It writes `u`, `uu` and `uz`, whose columns from n on are 0.
    """
    a, b, curvature = period.a, period.b, period.curvature
    n = a.shape[0]
    for k in range(TORQUES):
        q.u[k] = vx[n + k]
        for j in range(n + TORQUES):
            q.uz[k, j] = curvature[n + k, j] if j < n else 0.0
        for m in range(n):
            q.u[k] += b[m, k] * vx[m]
            for j in range(n):
                q.uz[k, j] += b[m, k] * va[m, j] + vxx[n + k, m] * a[m, j]
        for j in range(TORQUES):
            total = vxx[n + k, n + j] + curvature[n + k, n + j]
            for m in range(n):
                total += b[m, k] * vxx[m, n + j] + vxx[n + k, m] * b[m, j]
                for i in range(n):
                    total += b[m, k] * vxx[m, i] * b[i, j]
            q.uu[k, j] = total


@compiled
def add_torque_cost(weights: Floats, torque: Floats, before: Floats, q: Quadratic) -> None:
    """Add a period's cost of its torque and of the change since the period before.

    Args:
        weights: see `Model`.
        torque: of the period. Shape (2,).
        before: of the one before. Shape (2,).
        q: of `state_model` and `torque_model`; the last two entries of `z` and rows of `zz` are set.
    """
    n = q.z.shape[0] - TORQUES
    for k in range(TORQUES):
        amount, smooth = 2.0 * weights[0, k], 2.0 * weights[1, k]
        change = torque[k] - before[k]
        q.u[k] += amount * torque[k] + smooth * change
        q.uu[k, k] += amount + smooth
        q.uz[k, n + k] = -smooth
        q.z[n + k] = -smooth * change
        for j in range(TORQUES):
            q.zz[n + k, n + j] = smooth if j == k else 0.0


@compiled
def minimise(
    weights: Floats, bounds: Bounds, torque: Floats, q: Quadratic, box: Floats, step: Floats, gains: Floats
) -> None:
    """Find the best change of a period's torque within its limits, and its gains on z.

    Where the model bends less than the torques' own cost does, it is bent as much (a modified Newton method); where
    that is lost in rounding, a little more.

    Args:
        weights: see `Model`.
        bounds: of the steps.
        torque: at present. Shape (2,).
        q: the model.
        box: to work in. Shape (2, 2).
        step: receives the change. Shape (2,).
        gains: receives the gains; those of a torque at a limit are 0. Shape (2, n + 2).
    """
    (limits, regularisation), quu, quz = bounds, q.uu, q.uz
    for k in range(TORQUES):
        box[0, k], box[1, k] = -limits[k] - torque[k], limits[k] - torque[k]
    own_1, own_2 = 2.0 * (weights[0, 0] + weights[1, 0]), 2.0 * (weights[0, 1] + weights[1, 1])
    mean, half = 0.5 * (quu[0, 0] / own_1 + quu[1, 1] / own_2), 0.5 * (quu[0, 0] / own_1 - quu[1, 1] / own_2)
    spread = np.sqrt(half * half + quu[0, 1] * quu[0, 1] / (own_1 * own_2))
    lacking = max(max(1.0, LEAST_SHARE * (abs(mean) + spread)) - (mean - spread), 0.0)
    h11, h22 = quu[0, 0] + lacking * own_1 + regularisation[0], quu[1, 1] + lacking * own_2 + regularisation[1]
    h12 = quu[0, 1]
    determinant = h11 * h22 - h12 * h12
    box_minimum(h11, h12, h22, q.u[0], q.u[1], box, step)
    first_held = step[0] <= box[0, 0] or step[0] >= box[1, 0]
    second_held = step[1] <= box[0, 1] or step[1] >= box[1, 1]
    for j in range(gains.shape[1]):
        gains[0, j], gains[1, j] = 0.0, 0.0
        if not first_held and not second_held:
            gains[0, j] = (h12 * quz[1, j] - h22 * quz[0, j]) / determinant
            gains[1, j] = (h12 * quz[0, j] - h11 * quz[1, j]) / determinant
        elif not first_held:
            gains[0, j] = -quz[0, j] / h11
        elif not second_held:
            gains[1, j] = -quz[1, j] / h22


@compiled
def update_value(step: Floats, gains: Floats, q: Quadratic, vx: Floats, vxx: Floats) -> float:
    """Slope and curvature of the cost from a period on, under its step and gains.

    Args:
        step: of `minimise`.
        gains: of `minimise`.
        q: the model.
        vx: receives the slope.
        vxx: receives the curvature.

    Returns:
        Second-order part of the change of cost by the step.
    """
    bent_0 = q.uu[0, 0] * step[0] + q.uu[0, 1] * step[1]
    bent_1 = q.uu[1, 0] * step[0] + q.uu[1, 1] * step[1]
    for i in range(q.z.shape[0]):
        first, second = gains[0, i], gains[1, i]
        vx[i] = q.z[i] + first * (bent_0 + q.u[0]) + second * (bent_1 + q.u[1])
        vx[i] += q.uz[0, i] * step[0] + q.uz[1, i] * step[1]
        row_0 = q.uu[0, 0] * first + q.uu[0, 1] * second + q.uz[0, i]
        row_1 = q.uu[1, 0] * first + q.uu[1, 1] * second + q.uz[1, i]
        for j in range(i, q.z.shape[0]):
            value = q.zz[i, j] + row_0 * gains[0, j] + row_1 * gains[1, j]
            value += first * q.uz[0, j] + second * q.uz[1, j]
            vxx[i, j] = value
            vxx[j, i] = value
    return 0.5 * (step[0] * bent_0 + step[1] * bent_1)


@compiled
def backward(runs: Model, bounds: Bounds, found: Sweep) -> None:
    """Sweep backward through runs: steps and gains that minimise the quadratic model of each one's cost.

    Torques stay within the limits (control-limited differential dynamic programming).

    Args:
        runs: all runs, with defects and curvature.
        bounds: of the steps.
        found: receives what is found.
    """
    count, periods, n = runs.by_torque.shape[:3]
    size = n + TORQUES
    vx, va = np.zeros(size), np.zeros((n, n))
    box, (u, uu) = np.zeros((2, TORQUES)), (np.zeros(TORQUES), np.zeros((TORQUES, TORQUES)))
    q = Quadratic(np.zeros(size), np.zeros((size, size)), u, uu, np.zeros((TORQUES, size)))
    found.expected[:] = 0.0
    for run in range(count):
        for i in range(n):  # numba takes seconds to compile sums of arrays, with the text of their errors
            found.slopes[run, periods, i] += runs.gradient[run, periods, i]
            for j in range(n):
                found.curvatures[run, periods, i, j] += runs.hessian[run, periods, i, j]
        for t in range(periods - 1, -1, -1):
            torque, change, gains = runs.torques[run, t + 1], found.forward[run, t], found.gains[run, t]
            vxx = found.curvatures[run, t + 1]
            for i in range(size):
                vx[i] = found.slopes[run, t + 1, i]
                for j in range(n):
                    vx[i] += vxx[i, j] * runs.defects[run, min(t, runs.defects.shape[1] - 1), j]
            curvature = runs.curvature[run, min(t, runs.curvature.shape[1] - 1)]
            gradient, hessian = runs.gradient[run, t], runs.hessian[run, t]
            period = Period(runs.by_state[run, t], runs.by_torque[run, t], gradient, hessian, curvature)
            state_model(period, vx, vxx, va, q)
            torque_model(period, vx, vxx, va, q)
            add_torque_cost(runs.weights, torque, runs.torques[run, t], q)
            minimise(runs.weights, bounds, torque, q, box, change, gains)
            found.expected[run, 0] += change[0] * q.u[0] + change[1] * q.u[1]
            found.expected[run, 1] += update_value(change, gains, q, found.slopes[run, t], found.curvatures[run, t])
