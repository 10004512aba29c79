"""Compiled sweeps of differential dynamic programming: backward through runs, box-constrained, nothing allocated.

The state of the recursion is z = (x, p), the arm's state and the torque of the period before, so that a weight on the
change of the torque is a cost like the others. Shapes: n entries of x, N periods; z has n + 2 entries. The
functions call nothing outside this file (`kept_on_disk`).
"""

from __future__ import annotations

import numpy as np

from flexarm_baselines.arrays import Floats
from flexarm_env.codegen.cache import kept_on_disk

compiled = kept_on_disk(__file__, "sweeps of differential dynamic programming")
TORQUES = 2
LEAST_SHARE = 1e-14  # of the least curvature by the torques in the one of largest magnitude; rounding takes some 1e-16


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
def state_model(
    a: Floats,
    b: Floats,
    gradient: Floats,
    hessian: Floats,
    curvature: Floats,
    vx: Floats,
    vxx: Floats,
    va: Floats,
    qz: Floats,
    qzz: Floats,
) -> None:
    """Differentiate a period's cost and what follows by the arm's state x, whatever the torque.

    Args:
        a: A. Shape (n, n).
        b: B. Shape (n, 2).
        gradient: of the period's cost by x. Shape (n,).
        hessian: Shape (n, n).
        curvature: see `backward`. Shape (n + 2, n + 2).
        vx: slope of the cost of what follows by the next z. Shape (n + 2,).
        vxx: its curvature. Shape (n + 2, n + 2).
        va: receives the part of vxx by the states, times A. Shape (n, n).
        qz: receives the slope in its first n entries. Shape (n + 2,).
        qzz: receives the curvature's upper triangle in its first n rows; 0 beyond column n. Shape (n + 2, n + 2).
    """
    n = b.shape[0]
    for i in range(n):
        for j in range(n):
            va[i, j] = 0.0
        for m in range(n):
            factor = vxx[i, m]
            for j in range(n):
                va[i, j] += factor * a[m, j]
    for i in range(n):
        qz[i] = gradient[i]
        for j in range(n + TORQUES):
            qzz[i, j] = hessian[i, j] + curvature[i, j] if j < n else 0.0
        for m in range(n):
            factor = a[m, i]
            qz[i] += factor * vx[m]
            for j in range(i, n):
                qzz[i, j] += factor * va[m, j]


@compiled
def torque_model(
    a: Floats,
    b: Floats,
    curvature: Floats,
    vx: Floats,
    vxx: Floats,
    va: Floats,
    qu: Floats,
    quu: Floats,
    quz: Floats,
) -> None:
    """Differentiate what follows a period by its torque, without the torque's own cost.

    Args:
        a: see `state_model`.
        b: see `state_model`.
        curvature: see `state_model`.
        vx: see `state_model`.
        vxx: see `state_model`.
        va: of `state_model`.
        qu: receives the slope. Shape (2,).
        quu: receives the curvature. Shape (2, 2).
        quz: receives the curvature by torque and z; 0 from column n on. Shape (2, n + 2).
    """
    n = b.shape[0]
    for k in range(TORQUES):
        qu[k] = vx[n + k]
        for j in range(n + TORQUES):
            quz[k, j] = curvature[n + k, j] if j < n else 0.0
        for m in range(n):
            qu[k] += b[m, k] * vx[m]
            for j in range(n):
                quz[k, j] += b[m, k] * va[m, j] + vxx[n + k, m] * a[m, j]
        for j in range(TORQUES):
            total = vxx[n + k, n + j] + curvature[n + k, n + j]
            for m in range(n):
                total += b[m, k] * vxx[m, n + j] + vxx[n + k, m] * b[m, j]
                for i in range(n):
                    total += b[m, k] * vxx[m, i] * b[i, j]
            quu[k, j] = total


@compiled
def add_torque_cost(
    weights: Floats, torque: Floats, before: Floats, qu: Floats, quu: Floats, quz: Floats, qz: Floats, qzz: Floats
) -> None:
    """Add a period's cost of its torque and of the change since the period before.

    Args:
        weights: see `backward`.
        torque: of the period. Shape (2,).
        before: of the one before. Shape (2,).
        qu: see `torque_model`.
        quu: see `torque_model`.
        quz: see `torque_model`.
        qz: see `state_model`; its last two entries are set.
        qzz: see `state_model`; its last two rows are set.
    """
    n = qz.shape[0] - TORQUES
    for k in range(TORQUES):
        amount, smooth = 2.0 * weights[0, k], 2.0 * weights[1, k]
        change = torque[k] - before[k]
        qu[k] += amount * torque[k] + smooth * change
        quu[k, k] += amount + smooth
        quz[k, n + k] = -smooth
        qz[n + k] = -smooth * change
        for j in range(TORQUES):
            qzz[n + k, n + j] = smooth if j == k else 0.0


@compiled
def minimise(
    weights: Floats,
    torque: Floats,
    limits: Floats,
    regularisation: Floats,
    qu: Floats,
    quu: Floats,
    quz: Floats,
    box: Floats,
    step: Floats,
    gains: Floats,
) -> None:
    """Find the best change of a period's torque within its limits, and its gains on z.

    Where the model bends less than the torques' own cost does, it is bent as much (a modified Newton method); where
    that is lost in rounding, a little more.

    Args:
        weights: see `backward`.
        torque: at present. Shape (2,).
        limits: see `backward`.
        regularisation: see `backward`.
        qu: see `torque_model`.
        quu: see `torque_model`.
        quz: see `torque_model`.
        box: to work in. Shape (2, 2).
        step: receives the change. Shape (2,).
        gains: receives the gains; those of a torque at a limit are 0. Shape (2, n + 2).
    """
    for k in range(TORQUES):
        box[0, k], box[1, k] = -limits[k] - torque[k], limits[k] - torque[k]
    own_1, own_2 = 2.0 * (weights[0, 0] + weights[1, 0]), 2.0 * (weights[0, 1] + weights[1, 1])
    mean, half = 0.5 * (quu[0, 0] / own_1 + quu[1, 1] / own_2), 0.5 * (quu[0, 0] / own_1 - quu[1, 1] / own_2)
    spread = np.sqrt(half * half + quu[0, 1] * quu[0, 1] / (own_1 * own_2))
    lacking = max(max(1.0, LEAST_SHARE * (abs(mean) + spread)) - (mean - spread), 0.0)
    h11, h22 = quu[0, 0] + lacking * own_1 + regularisation[0], quu[1, 1] + lacking * own_2 + regularisation[1]
    h12 = quu[0, 1]
    determinant = h11 * h22 - h12 * h12
    box_minimum(h11, h12, h22, qu[0], qu[1], box, step)
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
def update_value(
    step: Floats,
    gains: Floats,
    qu: Floats,
    quu: Floats,
    quz: Floats,
    qz: Floats,
    qzz: Floats,
    vx: Floats,
    vxx: Floats,
) -> float:
    """Slope and curvature of the cost from a period on, under its step and gains.

    Args:
        step: of `minimise`.
        gains: of `minimise`.
        qu: see `torque_model`.
        quu: see `torque_model`.
        quz: see `torque_model`.
        qz: see `state_model`.
        qzz: see `state_model`.
        vx: receives the slope.
        vxx: receives the curvature.

    Returns:
        Second-order part of the change of cost by the step.
    """
    bent_0 = quu[0, 0] * step[0] + quu[0, 1] * step[1]
    bent_1 = quu[1, 0] * step[0] + quu[1, 1] * step[1]
    for i in range(qz.shape[0]):
        first, second = gains[0, i], gains[1, i]
        vx[i] = qz[i] + first * (bent_0 + qu[0]) + second * (bent_1 + qu[1])
        vx[i] += quz[0, i] * step[0] + quz[1, i] * step[1]
        row_0 = quu[0, 0] * first + quu[0, 1] * second + quz[0, i]
        row_1 = quu[1, 0] * first + quu[1, 1] * second + quz[1, i]
        for j in range(i, qz.shape[0]):
            value = qzz[i, j] + row_0 * gains[0, j] + row_1 * gains[1, j]
            value += first * quz[0, j] + second * quz[1, j]
            vxx[i, j] = value
            vxx[j, i] = value
    return 0.5 * (step[0] * bent_0 + step[1] * bent_1)


@compiled
def backward(
    by_state: Floats,
    by_torque: Floats,
    defects: Floats,
    gradient: Floats,
    hessian: Floats,
    curvature: Floats,
    weights: Floats,
    torques: Floats,
    limits: Floats,
    regularisation: Floats,
    feedforward: Floats,
    gains: Floats,
    slopes: Floats,
    curvatures: Floats,
    expected: Floats,
) -> None:
    """Sweep backward through runs: steps and gains that minimise the quadratic model of each one's cost.

    Torques stay within the limits (control-limited differential dynamic programming). R runs, independent of each
    other.

    Args:
        by_state: A of each period. Shape (R, N, n, n).
        by_torque: B. Shape (R, N, n, 2).
        defects: by how much each period of a run ends beyond the next state; 0 where it follows the dynamics.
            Shape (R, N, n), or (R, 1, n) for all periods.
        gradient: of the cost, by each state. Shape (R, N + 1, n).
        hessian: Shape (R, N + 1, n, n).
        curvature: of the dynamics, second derivatives of each period's end by state and torque in the direction of
            the cost's slope there; 0 for iterative LQR. Shape (R, N, n + 2, n + 2), or (R, 1, n + 2, n + 2) for all
            periods.
        weights: on squared torques, and on their squared changes. Shape (2, 2).
        torques: of the period before the first, then of each. Shape (R, N + 1, 2).
        limits: largest magnitudes. Shape (2,).
        regularisation: added to the curvature by each torque. Shape (2,).
        feedforward: receives the changes of the torques. Shape (R, N, 2).
        gains: receives the gains on z. Shape (R, N, 2, n + 2).
        slopes: of the cost from each instant on, by z; the last one is that of a cost beyond the end, to which the
            end's own is added, the others are received. Shape (R, N + 1, n + 2).
        curvatures: as `slopes`. Shape (R, N + 1, n + 2, n + 2).
        expected: receives the first- and second-order part of the change of the cost that the model expects of the
            full step. Shape (R, 2).
    """
    runs, periods, n = by_torque.shape[:3]
    size = n + TORQUES
    vx, vxx, va = np.zeros(size), np.zeros((size, size)), np.zeros((n, n))
    qz, qzz, quz = np.zeros(size), np.zeros((size, size)), np.zeros((TORQUES, size))
    qu, quu, box = np.zeros(TORQUES), np.zeros((TORQUES, TORQUES)), np.zeros((2, TORQUES))
    expected[:] = 0.0
    for run in range(runs):
        slopes[run, periods, :n] += gradient[run, periods]
        curvatures[run, periods, :n, :n] += hessian[run, periods]
        vx[:], vxx[:] = slopes[run, periods], curvatures[run, periods]
        for t in range(periods - 1, -1, -1):
            a, b, bent = by_state[run, t], by_torque[run, t], curvature[run, min(t, curvature.shape[1] - 1)]
            u, before, change, law = torques[run, t + 1], torques[run, t], feedforward[run, t], gains[run, t]
            for i in range(size):
                for j in range(n):
                    vx[i] += vxx[i, j] * defects[run, min(t, defects.shape[1] - 1), j]
            state_model(a, b, gradient[run, t], hessian[run, t], bent, vx, vxx, va, qz, qzz)
            torque_model(a, b, bent, vx, vxx, va, qu, quu, quz)
            add_torque_cost(weights, u, before, qu, quu, quz, qz, qzz)
            minimise(weights, u, limits, regularisation, qu, quu, quz, box, change, law)
            expected[run, 0] += change[0] * qu[0] + change[1] * qu[1]
            expected[run, 1] += update_value(change, law, qu, quu, quz, qz, qzz, vx, vxx)
            slopes[run, t], curvatures[run, t] = vx, vxx
