"""Gradients by the torque-driven arm's state before some Runge-Kutta steps: recorded formulas and drivers.

`imex` explains lanes, blocks and arenas, `step_jacobians` what is differentiated.

A gradient g' by the state after a step goes back to that by the state before it. Of a stage with the rate f = (v, a),
the gradient by f is its share of the step's plus what the stage after it hands back. That by the stage's coordinates
and rates follows from ``g_a' da = mu' d(imbalance)`` with ``M mu = g_a`` (`dynamics.imbalance`), so that one solution
serves all inputs, where a Jacobian needs one for each.

Source: Griewank & Walther, *Evaluating Derivatives*, 2nd edition, SIAM 2008, chapter 3 (adjoint mode).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.arrays import Arena, LaneRows
from flexarm_env.codegen.declarations import Program
from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.tangents import tangents, varied
from flexarm_env.kernels.entries import constant
from flexarm_env.kernels.layout import row, slope_ways
from flexarm_env.kernels.recorder import Recorder, recorded_kernel
from flexarm_env.kernels.states import ArmTable, States, internal_place, load_arms, load_rows, load_states
from flexarm_env.kernels.step_jacobians import STAGES, stage_angles
from flexarm_env.kernels.tableau import RK4_NODES, RK4_WEIGHTS
from flexarm_env.kernels.variants import Variant, variant
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics import linear_algebra
from flexarm_env.physics.linear_algebra import plus_scaled

Gradients = tuple[NDArray[np.float64], NDArray[np.float64]]


def trail_rows(size: int) -> int:
    """Return how many numbers of a lane a step leaves for the way back: of its stages, with `size` coordinates."""
    return 3 * STAGES * size


# --- recorded ---------------------------------------------------------------------------------------------------------


def stages_record(variant: Variant) -> Recorder:
    """Record a step: coordinates, rates and accelerations of its stages, and its end."""
    r = Recorder(variant)
    known, h = [*r.read("CONSTANTS"), *r.read("ELIMINATION")], r.trace.input("h")
    y, v = r.read("Y"), r.read("V")
    stage_y, stage_v, total = y, v, [0.0] * (2 * len(y))
    for number, (next_node, weight) in enumerate(zip((*RK4_NODES[1:], 0.0), RK4_WEIGHTS, strict=True)):
        turn = sincos(dyn.elbow_turn(stage_y))
        slope = r.trace.call("slope", [*known, *stage_y, *stage_v, *r.read("TAU"), *turn], len(v))
        stage = [*stage_y, *stage_v, *slope]
        r.store("stages", stage, number * len(stage))
        total = plus_scaled(total, weight, [*stage_v, *slope])
        ahead = h * next_node
        stage_y, stage_v = plus_scaled(y, ahead, stage_v), plus_scaled(v, ahead, slope)
    moved = plus_scaled([*y, *v], h / 6.0, total)
    r.write("Y", moved[: variant.size])
    r.write("V", moved[variant.size :])
    return r


def stage_gradient_record(variant: Variant) -> Recorder:
    """Record the way back through one stage."""
    r = Recorder(variant)
    size = variant.size
    weight, ahead = r.trace.input("weight"), r.trace.input("ahead")
    numbers, k = r.rows_of("stage", 3 * size), r.constants()
    y, v, rates = numbers[:size], numbers[size : 2 * size], numbers[2 * size :]
    whole, later = r.read("GRADIENT"), r.read("STAGE_GRADIENT")
    by_rate = [weight * a + ahead * b for a, b in zip(whole, later, strict=True)]
    mass = dyn.mass_matrix(k, y, *stage_angles(variant, k, y)[:2])
    forces = linear_algebra.solve(linear_algebra.factor(mass), by_rate[size:])
    ways = [way for way in slope_ways(variant.modes) if way[0] != "quantity"]
    dual_y = [y[0], *varied(y[1:], [way for way in ways if way[0] == "y"])]
    dual_v, dual_tau = (
        varied(x, [way for way in ways if way[0] == name]) for x, name in ((v, "v"), (r.read("TAU"), "tau"))
    )
    off = dyn.imbalance(k, variant.complete, dual_y, dual_v, rates, dual_tau, stage_angles(variant, k, dual_y))
    found = [linear_algebra.dot(forces, [tangents(force).get(way, 0.0) for force in off]) for way in ways]
    # a1 acts through a2 - a1 alone
    by_y = [-found[variant.modes], *found[: size - 1]]
    by_v = [a + b for a, b in zip(by_rate[:size], found[size - 1 :], strict=False)]
    by_state = [*by_y, *by_v]
    r.write("STAGE_GRADIENT", by_state)
    for name, change in (("GRADIENT_CHANGE", by_state), ("TORQUE_GRADIENT", found[2 * size - 1 :])):
        r.write(name, [a + b for a, b in zip(r.read(name), change, strict=True)])
    return r


@recorded_kernel(stages_record)
def stages_kernel(arena: Arena, stages: LaneRows, h: float) -> None:
    """Take every lane over a step.

    Args:
        arena: of one block.
        stages: receives coordinates, rates and accelerations of the stages. Shape (stages * 3 * size, lanes).
        h: step [s].
    """


@recorded_kernel(stage_gradient_record)
def stage_gradient_kernel(arena: Arena, stage: LaneRows, weight: float, ahead: float) -> None:
    """Take the gradient of every lane back through a stage.

    Args:
        arena: of one block; the gradient of the stage after this one in STAGE_GRADIENT, which receives the stage's own.
        stage: its coordinates, rates and acceleration. Shape (3 * size, lanes).
        weight: of the stage in the step [s].
        ahead: time of the stage after it from the step's start; 0 for the last one [s].
    """


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
        trail: to work in. Shape (steps * stages * 3 * size, lanes).
        arms: what kernels know of each (`layout.arm_rows`), or of all. Shape (arms or 1, numbers).
        torques: Shape (arms, 2) [N m].
        h: step [s].
        steps: how many.
        states: before the steps, public. Shape (arms, 2 * size).
        weights: of the entries of the states after them. Shape (arms, 2 * size).
        gradients: receive the derivatives by states and torques. Shapes (arms, 2 * size), (arms, 2).
    """
    rows = 3 * STAGES * variant.size  # of a step
    for first in range(0, states.shape[0], variant.lanes):
        load_arms(arena, row.CONSTANTS, arms, first)
        load_rows(arena, row.TAU, torques, first)
        load_states(arena, states, first)
        for step in range(steps):
            stages: LaneRows = trail[step * rows : step * rows + rows]
            stages_kernel(arena, stages, h)
        load_gradient(arena, weights, first)
        for back in range(steps):
            begin = (steps - 1 - back) * rows
            latest: LaneRows = trail[begin : begin + rows]
            step_back(arena, latest, h)
        store_gradients(arena, gradients, first)


def step_back(arena: Arena, stages: LaneRows, h: float) -> None:
    """Take the gradient back through a step; `stages` of `stages_kernel`."""
    for r in range(2 * variant.size):
        for i in range(variant.lanes):
            arena[row.STAGE_GRADIENT + r, i] = 0.0
            arena[row.GRADIENT_CHANGE + r, i] = 0.0
    ahead = 0.0
    for back in range(STAGES):
        number = STAGES - 1 - back
        begin = 3 * variant.size * number
        stage: LaneRows = stages[begin : begin + 3 * variant.size]
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
    closed=True,
    words="gradients of an arm driven by torques",
)
