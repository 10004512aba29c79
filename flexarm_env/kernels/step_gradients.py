"""Gradients by the torque-driven arm's state before some Runge-Kutta steps: recorded formulas and drivers.

`imex` explains lanes, blocks and arenas, `step_jacobians` what is differentiated.

The gradient by the state after a step (positions y, momenta p = M(y) v) gives that by the state before it. The gradient
(g_v, g_F) by the rates (v, F) of a stage is their share of the step's plus what the stage after it contributes. With mu
from ``M mu = g_v + (dF/dv)^T g_F``, the gradient by the stage's momenta is mu, and that by its positions is
``(dF/dy)^T g_F - (d(M v)/dy)^T mu``: one solution serves all inputs.

Source: Griewank & Walther, *Evaluating Derivatives*, 2nd edition, SIAM 2008, chapter 3 (adjoint mode).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.arrays import Arena, LaneRows
from flexarm_env.codegen.declarations import Program
from flexarm_env.codegen.rows import lane_rows
from flexarm_env.codegen.tangents import tangents, varied
from flexarm_env.kernels.entries import constant
from flexarm_env.kernels.layout import row, slope_ways
from flexarm_env.kernels.recorded import momentum_kernel
from flexarm_env.kernels.recorder import Recorder, recorded_kernel
from flexarm_env.kernels.states import ArmTable, States, internal_place, load_arms, load_rows, load_states
from flexarm_env.kernels.step_jacobians import RK4_STAGES, stage_angles, stages_kernel
from flexarm_env.kernels.tableau import RK4_NODES, RK4_WEIGHTS
from flexarm_env.kernels.variants import variant
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics import linear_algebra
from flexarm_env.physics.linear_algebra import plus_scaled

Gradients = tuple[NDArray[np.float64], NDArray[np.float64]]


def trail_rows(size: int, steps: int) -> int:
    """Return how many numbers of a lane the way back needs: `size` coordinates and rates a stage, and at the end."""
    return 2 * size * (RK4_STAGES * steps + 1)


# --- recorded ---------------------------------------------------------------------------------------------------------


def pulled_back(weights: Sequence[Any], numbers: Sequence[Any], ways: Sequence[tuple[str, int]]) -> list[Any]:
    """Return the derivatives of a weighted sum of numbers."""
    return [linear_algebra.dot(weights, [tangents(number).get(way, 0.0) for number in numbers]) for way in ways]


@recorded_kernel
def stage_gradient_kernel(r: Recorder, arena: Arena, stage: LaneRows, weight: float, ahead: float) -> None:
    """Take the gradient of every lane back through a stage.

    Args:
        r: records it.
        arena: of one block; the gradient of the stage after this one in STAGE_GRADIENT, which receives the stage's own.
        stage: its coordinates and rates. Shape (2 * size, lanes).
        weight: of the stage in the step [s].
        ahead: time of the stage after it from the step's start; 0 for the last one [s].
    """
    size = r.variant.size
    numbers, k = r.rows_of("stage", 2 * size), r.constants()
    y, v = numbers[:size], numbers[size:]
    by_rate = plus_scaled([weight * a for a in r.read("GRADIENT")], ahead, r.read("STAGE_GRADIENT"))
    by_force = by_rate[size:]
    kinds = {kind: [way for way in slope_ways(r.variant.modes) if way[0] == kind] for kind in ("y", "v")}
    dual_y, dual_v = [y[0], *varied(y[1:], kinds["y"])], varied(v, kinds["v"])
    angles = stage_angles(r.variant, k, dual_y)
    force = dyn.momentum_rate(k, r.variant.complete, dual_y, dual_v, (0.0, 0.0), angles)
    by_v = [a + b for a, b in zip(by_rate[:size], pulled_back(by_force, force, kinds["v"]), strict=True)]
    mass = dyn.mass_matrix(k, y, *stage_angles(r.variant, k, y)[:2])
    by_p = linear_algebra.solve(linear_algebra.factor(mass), by_v)
    momenta = dyn.momentum(k, dual_y, v, *angles[:2])
    by_y = [
        a - b
        for a, b in zip(pulled_back(by_force, force, kinds["y"]), pulled_back(by_p, momenta, kinds["y"]), strict=True)
    ]
    by_state = [-by_y[r.variant.modes], *by_y, *by_p]  # a1 acts through a2 - a1 alone
    by_torque = [linear_algebra.dot(by_force, dyn.generalised_torque(k, tau)) for tau in ((1.0, 0.0), (0.0, 1.0))]
    r.write("STAGE_GRADIENT", by_state)
    for name, change in (("GRADIENT_CHANGE", by_state), ("TORQUE_GRADIENT", by_torque)):
        r.write(name, [a + b for a, b in zip(r.read(name), change, strict=True)])


@recorded_kernel
def begin_gradient_kernel(r: Recorder, arena: Arena, stage: LaneRows) -> None:
    """Turn GRADIENT, by positions and momenta of a period's begin, into that by positions and rates.

    Args:
        r: records it.
        arena: of one block.
        stage: coordinates and rates of the first stage. Shape (2 * size, lanes).
    """
    size, k = r.variant.size, r.constants()
    numbers, whole = r.rows_of("stage", 2 * size), r.read("GRADIENT")
    y, v, by_p = numbers[:size], numbers[size:], whole[size:]
    ways = [way for way in slope_ways(r.variant.modes) if way[0] == "y"]
    dual_y = [y[0], *varied(y[1:], ways)]
    found = pulled_back(by_p, dyn.momentum(k, dual_y, v, *stage_angles(r.variant, k, dual_y)[:2]), ways)
    by_v = dyn.momentum(k, y, by_p, *stage_angles(r.variant, k, y)[:2])
    by_y = [-found[r.variant.modes], *found]
    r.write("GRADIENT", [*(a + b for a, b in zip(whole[:size], by_y, strict=True)), *by_v])


# --- drivers ----------------------------------------------------------------------------------------------------------


def run_gradients(
    arena: Arena,
    trail: LaneRows,
    arms: ArmTable,
    torques: ArmTable,
    h: float,
    steps: int,
    states: States,
    weights: States,
    gradients: Gradients,
) -> None:
    """Differentiate a weighted sum of the entries of the public states that many arms reach.

    Args:
        arena: to work in.
        trail: to work in. Shape (trail_rows(size, steps), lanes).
        arms: what kernels know of each (`layout.arm_rows`), or of all. Shape (arms or 1, numbers).
        torques: held over all steps [N m]. Shape (arms, 2).
        h: step [s].
        steps: how many.
        states: before the steps, public. Shape (arms, 2 * size).
        weights: of the entries of the states after them. Shape (arms, 2 * size).
        gradients: receive the derivatives by states and torques. Shapes (arms, 2 * size), (arms, 2).
    """
    arena = lane_rows(arena, variant.lanes)
    trail = lane_rows(trail, variant.lanes)
    rows = 2 * RK4_STAGES * variant.size  # of a step
    for first in range(0, states.shape[0], variant.lanes):
        load_arms(arena, row.CONSTANTS, arms, first)
        load_rows(arena, row.TAU, torques, first)
        load_states(arena, states, first)
        momentum_kernel(arena)
        for step in range(steps):
            stages: LaneRows = trail[step * rows : step * rows + rows]
            stages_kernel(arena, stages, h)
        load_gradient(arena, weights, first)
        last: LaneRows = trail[steps * rows : steps * rows + 2 * variant.size]
        end_back(arena, last)
        for back in range(steps):
            begin = (steps - 1 - back) * rows
            latest: LaneRows = trail[begin : begin + rows]
            step_back(arena, latest, h)
        start: LaneRows = trail[: 2 * variant.size]
        begin_gradient_kernel(arena, start)
        store_gradients(arena, gradients, first)


def end_back(arena: Arena, last: LaneRows) -> None:
    """Turn GRADIENT by the positions and rates that a period ends with into that by positions and momenta.

    Args:
        arena: of one block.
        last: receives the period's end. Shape (2 * size, lanes).
    """
    for r in range(2 * variant.size):
        for i in range(variant.lanes):
            rate = r >= variant.size
            last[r, i] = arena[row.Y + r, i]
            arena[row.STAGE_GRADIENT + (r + variant.size) % (2 * variant.size), i] = (
                arena[row.GRADIENT + r, i] if rate else 0.0
            )
            arena[row.GRADIENT_CHANGE + r, i] = 0.0 if rate else arena[row.GRADIENT + r, i]
    stage_gradient_kernel(arena, last, 0.0, 1.0)
    for r in range(2 * variant.size):
        for i in range(variant.lanes):
            arena[row.GRADIENT + r, i] = arena[row.GRADIENT_CHANGE + r, i]


def step_back(arena: Arena, stages: LaneRows, h: float) -> None:
    """Take the gradient back through a step; `stages` of `stages_kernel`."""
    for r in range(2 * variant.size):
        for i in range(variant.lanes):
            arena[row.STAGE_GRADIENT + r, i] = 0.0
            arena[row.GRADIENT_CHANGE + r, i] = 0.0
    ahead = 0.0
    for back in range(RK4_STAGES):
        number = RK4_STAGES - 1 - back
        begin = 2 * variant.size * number
        stage: LaneRows = stages[begin : begin + 2 * variant.size]
        stage_gradient_kernel(arena, stage, h * RK4_WEIGHTS[number] / 6.0, ahead)
        ahead = h * RK4_NODES[number]
    for r in range(2 * variant.size):
        for i in range(variant.lanes):
            arena[row.GRADIENT + r, i] += arena[row.GRADIENT_CHANGE + r, i]


def load_gradient(arena: Arena, weights: States, first: int) -> None:
    """Begin with the gradient by the internal state of a sum over the public one's entries."""
    for i in range(variant.lanes):
        own = weights[min(first + i, weights.shape[0] - 1)]
        for part in range(2):
            begin, entry = row.GRADIENT + part * variant.size, part * variant.size
            for n in range(variant.size):
                arena[begin + internal_place(n), i] = own[entry + n]
            turn = own[entry + 1]  # theta2 is a2 without a1 and the turn of link 1's tip
            arena[begin, i] -= turn
            for n in range(variant.modes):
                arena[begin + 1 + n, i] -= arena[row.CONSTANTS + constant.ELBOW_SLOPES + n, i] * turn
        for n in range(2):
            arena[row.TORQUE_GRADIENT + n, i] = 0.0


def store_gradients(arena: Arena, gradients: Gradients, first: int) -> None:
    """Copy a block's gradients out as those by public states."""
    by_state, by_torque = gradients
    for i in range(min(variant.lanes, by_state.shape[0] - first)):
        for part in range(2):
            begin, entry = row.GRADIENT + part * variant.size, part * variant.size
            turn = arena[begin + variant.modes + 1, i]  # a2 turns with all of theta1, link 1's tip, theta2
            for n in range(variant.size):
                by_state[first + i, entry + n] = arena[begin + internal_place(n), i]
            by_state[first + i, entry] += turn
            for n in range(variant.modes):
                slope = arena[row.CONSTANTS + constant.ELBOW_SLOPES + n, i]
                by_state[first + i, entry + 2 + n] += slope * turn
        for n in range(2):
            by_torque[first + i, n] = arena[row.TORQUE_GRADIENT + n, i]


GRADIENTS = Program(
    "gradients",
    entry_points=(run_gradients,),
    groups=frozenset({"adjoint"}),
    allocation_free=True,
    description="gradients of an arm driven by torques",
)
