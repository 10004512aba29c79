"""Jacobians of the torque-driven arm's state after some Runge-Kutta steps: recorded formulas and drivers.

`imex` explains lanes, blocks and arenas.

A step of the discrete method is differentiated, not the continuous motion. A *column* is the derivative of the state
with respect to one input: a public coordinate or rate at the start, a held torque, a quantity. It is of positions y and
rates v at the ends of a period, and of positions and momenta ``p = M(y) v`` in between. At each stage

    dv = M^-1 (dp - d(M v)),    d(p') = dF(y, v),

where d(M v) is at constant v; the derivatives of M v and of F = p' are the stage's *slopes*, by which each column is
carried through the four stages.

The arm has no preferred direction: M and F depend on a1 and a2 through a2 - a1 alone, so there are slopes for the
positions a2, q1, q2 only, and the column of theta1 is a unit vector.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.arrays import Arena, LaneRows
from flexarm_env.codegen.declarations import Program
from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.rows import lane_rows
from flexarm_env.codegen.tangents import tangents, varied
from flexarm_env.kernels.entries import constant
from flexarm_env.kernels.layout import row, slope_sizes, slope_ways
from flexarm_env.kernels.recorded import driven, momentum_kernel, move, slopes_at
from flexarm_env.kernels.recorder import Recorder, recorded_kernel, sine_of_theta2
from flexarm_env.kernels.states import (
    ArmTable,
    States,
    internal_place,
    load_arms,
    load_rows,
    load_states,
    store_state,
    store_states,
)
from flexarm_env.kernels.step_columns import (
    begin_column_kernel,
    column_kernel,
    end_column_kernel,
    input_column_kernel,
    input_end_column_kernel,
)
from flexarm_env.kernels.tableau import RK4_NODES, RK4_WEIGHTS
from flexarm_env.kernels.variants import Variant, variant
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics import linear_algebra
from flexarm_env.physics.constants import ARM_QUANTITIES, Constants, varied_constants
from flexarm_env.physics.linear_algebra import plus_scaled

Jacobians = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
RK4_STAGES = len(RK4_NODES)
ARM_QUANTITY_COUNT = len(ARM_QUANTITIES)


# --- recorded ---------------------------------------------------------------------------------------------------------


def stage_angles(variant: Variant, k: Constants, y: Sequence[Any]) -> tuple[Any, Any, Any]:
    """Return the cosine and sine of a2 - a1, and the sine of theta2 where it is used."""
    sin, cos = sincos(dyn.elbow_turn(y))
    return cos, sin, sine_of_theta2(variant, k, y)


@recorded_kernel
def first_rates_kernel(r: Recorder, arena: Arena) -> None:
    """Begin TOTAL, the sum of a step's rates, with those of its start.

    By itself it rounds a force and a torque once, as the plans and filters of the published board have it; within
    `stages_kernel`, which needs the torque's part again, they are rounded twice, as in `step_kernel`.
    """
    r.write("TOTAL", [*r.read("V"), *driven(r.constants(), r.read("FORCE"), r.read("TAU"))])


@recorded_kernel
def stages_kernel(r: Recorder, arena: Arena, stages: LaneRows, h: float) -> None:
    """Take every lane over a step.

    Args:
        r: records it.
        arena: of one block.
        stages: receives coordinates and rates of the stages. Shape (stages * 2 * size, lanes).
        h: step [s].
    """
    k, y, p = r.constants(), r.read("Y"), r.read("P")
    stage_y, slopes, total = y, [*r.read("V"), *r.read("FORCE")], [0.0] * (2 * len(y))
    begun = "TOTAL" in r.variant.rows  # by `first_rates_kernel`; gradients go without
    for number, (next_node, weight) in enumerate(zip((*RK4_NODES[1:], None), RK4_WEIGHTS, strict=True)):
        v = slopes[: len(y)]
        r.store("stages", [*stage_y, *v], number * 2 * len(y))
        rates = [*v, *driven(k, slopes[len(y) :], r.read("TAU"))]
        total = r.read("TOTAL") if begun and number == 0 else plus_scaled(total, weight, rates)
        if next_node is not None:
            stage_y, stage_p = (plus_scaled(a, h * next_node, b) for a, b in ((y, v), (p, rates[len(y) :])))
            slopes = slopes_at(r, stage_y, stage_p)
    move(r, h, total)


@recorded_kernel
def slopes_kernel(r: Recorder, arena: Arena, stage: LaneRows, slopes: LaneRows) -> None:
    """Compute the slopes of a stage of every lane.

    Args:
        r: records it.
        arena: of one block.
        stage: its coordinates and rates. Shape (2 * size, lanes).
        slopes: receives them, in the order of `slope_sizes`. Shape (slope_rows, lanes).
    """
    k, numbers = r.constants(), r.rows_of("stage", 2 * r.variant.size)
    y, v = numbers[: r.variant.size], numbers[r.variant.size :]
    kinds = {kind: [way for way in slope_ways(r.variant.modes) if way[0] == kind] for kind in ("y", "v", "quantity")}
    dual_y, dual_v = [y[0], *varied(y[1:], kinds["y"])], varied(v, kinds["v"])
    dual_k = varied_constants(k, r.constant_derivatives(), kinds["quantity"])
    angles = stage_angles(r.variant, dual_k, dual_y)
    momenta = dyn.momentum(dual_k, dual_y, v, *angles[:2])
    forces = dyn.momentum_rate(dual_k, r.variant.complete, dual_y, dual_v, (0.0, 0.0), angles)
    mass = dyn.mass_matrix(k, y, *stage_angles(r.variant, k, y)[:2])
    lower = [mass[i][j] for i in range(r.variant.size) for j in range(i + 1)]

    def by(numbers: Sequence[Any], way: tuple[str, int]) -> list[Any]:
        return [tangents(number).get(way, 0.0) for number in numbers]

    inputs = [[*([0.0] * r.variant.size), *dyn.generalised_torque(k, tau)] for tau in ((1.0, 0.0), (0.0, 1.0))]
    inputs += [[*by(momenta, way), *by(forces, way)] for way in kinds["quantity"]]
    parts = {
        "mass": lower,
        "inverse": linear_algebra.inverse(lower, r.variant.size),
        "momentum_by_y": [x for way in kinds["y"] for x in by(momenta, way)],
        "force_by_y": [x for way in kinds["y"] for x in by(forces, way)],
        "force_by_v": [x for way in kinds["v"] for x in by(forces, way)],
        "inputs": [x for numbers in inputs for x in numbers],
    }
    assert {name: len(values) for name, values in parts.items()} == slope_sizes(r.variant.modes)
    r.store("slopes", [x for values in parts.values() for x in values])


# --- drivers ----------------------------------------------------------------------------------------------------------


def run_tangents(
    arena: Arena,
    arms: ArmTable,
    changes: ArmTable,
    torques: ArmTable,
    h: float,
    steps: int,
    states: States,
    jacobians: Jacobians,
) -> None:
    """Advance many arms by the same number of steps, torques held, and give the Jacobians of their public states.

    Args:
        arena: to work in.
        arms: what kernels know of each (`layout.arm_rows`), or of all. Shape (arms or 1, numbers).
        changes: derivatives of the constants by each quantity. Shape (arms or 1, quantities * constants).
        torques: held over all steps [N m]. Shape (arms, 2).
        h: step [s].
        steps: how many.
        states: public, before the steps; receives those after them. Shape (arms, 2 * size).
        jacobians: by states, by torques, by quantities. Shapes (arms, 2 * size, columns).
    """
    arena = lane_rows(arena, variant.lanes)
    for first in range(0, states.shape[0], variant.lanes):
        load_arms(arena, row.CONSTANTS, arms, first)
        load_arms(arena, row.CHANGES, changes, first)
        load_rows(arena, row.TAU, torques, first)
        load_states(arena, states, first)
        momentum_kernel(arena)
        start_columns(arena)
        for step in range(steps):
            find_slopes(arena, h)
            if step == 0:
                begin_columns(arena)
            carry_columns(arena, h)
        end_columns(arena)
        store_states(arena, states, first)
        store_columns(arena, jacobians, first)


def find_slopes(arena: Arena, h: float) -> None:
    """Take every lane over a step, and compute the slopes of its stages."""
    size = 2 * variant.size
    stages: LaneRows = arena[row.STAGES : row.STAGES + RK4_STAGES * size]
    first_rates_kernel(arena)
    stages_kernel(arena, stages, h)
    for number in range(RK4_STAGES):
        stage: LaneRows = stages[number * size : number * size + size]
        begin = row.SLOPES + number * variant.slope_rows
        slopes: LaneRows = arena[begin : begin + variant.slope_rows]
        slopes_kernel(arena, stage, slopes)


def begin_columns(arena: Arena) -> None:
    """Turn all columns from rates to momenta by the slopes of the first stage; an acting input's is read off them."""
    slopes: LaneRows = arena[row.SLOPES : row.SLOPES + variant.slope_rows]
    for n in range(variant.ways):
        begin = row.COLUMNS + 2 * variant.size * n
        column: LaneRows = arena[begin : begin + 2 * variant.size]
        if n < 2 * variant.size - 1:
            begin_column_kernel(column, slopes)
        else:
            for r in range(variant.size):
                for i in range(variant.lanes):
                    column[variant.size + r, i] = slopes[input_row(n) + r, i]


def carry_columns(arena: Arena, h: float) -> None:
    """Carry all columns over the coming step."""
    slopes: LaneRows = arena[row.SLOPES : row.SLOPES + RK4_STAGES * variant.slope_rows]
    for n in range(variant.ways):
        begin = row.COLUMNS + 2 * variant.size * n
        column: LaneRows = arena[begin : begin + 2 * variant.size]
        if n < 2 * variant.size - 1:
            column_kernel(column, slopes, h)
        else:
            acting: LaneRows = slopes[input_row(n) : RK4_STAGES * variant.slope_rows]
            input_column_kernel(column, slopes, acting, h)


def end_columns(arena: Arena) -> None:
    """Turn all columns from momenta to rates, by the slopes of the period's end."""
    end: LaneRows = arena[row.Y : row.Y + 2 * variant.size]  # rates follow coordinates
    slopes: LaneRows = arena[row.SLOPES : row.SLOPES + variant.slope_rows]
    slopes_kernel(arena, end, slopes)
    for n in range(variant.ways):
        begin = row.COLUMNS + 2 * variant.size * n
        column: LaneRows = arena[begin : begin + 2 * variant.size]
        if n < 2 * variant.size - 1:
            end_column_kernel(column, slopes)
        else:
            acting: LaneRows = slopes[input_row(n) : variant.slope_rows]
            input_end_column_kernel(column, slopes, acting)


def input_row(way: int) -> int:
    """Return the first row, among a stage's slopes, of an input that acts all the time; the inputs come last."""
    return variant.slope_rows - 2 * variant.size * (variant.ways - way)


def start_columns(arena: Arena) -> None:
    """Initialise the columns: derivatives of the internal state by the public one, without theta1's."""
    for r in range(2 * variant.size * variant.ways):
        for i in range(variant.lanes):
            arena[row.COLUMNS + r, i] = 0.0
    for n in range(2 * variant.size - 1):
        part = (n + 1) // variant.size  # coordinates, rates
        entry = (n + 1) % variant.size  # theta1, theta2, q1, q2
        column = row.COLUMNS + 2 * variant.size * n + part * variant.size
        moved, turned = internal_place(entry), internal_place(1)
        for i in range(variant.lanes):
            arena[column + moved, i] = 1.0
            if entry == 0:  # what turns link 1 turns link 2 with it
                arena[column + turned, i] = 1.0
            elif 1 < entry < variant.modes + 2:
                arena[column + turned, i] = arena[row.CONSTANTS + constant.ELBOW_SLOPES + entry - 2, i]


def store_columns(arena: Arena, jacobians: Jacobians, first: int) -> None:
    """Copy the columns of a block out as derivatives of public states."""
    by_state, by_torque, by_quantity = jacobians
    length = 2 * variant.size  # of a state, and of a column
    for i in range(min(variant.lanes, by_state.shape[0] - first)):
        for r in range(length):
            by_state[first + i, r, 0] = 1.0 if r == 0 else 0.0
        for n in range(length - 1):
            store_state(arena, i, row.COLUMNS + length * n, by_state[first + i, :, n + 1])
        for n in range(2):
            store_state(arena, i, row.COLUMNS + length * (length - 1 + n), by_torque[first + i, :, n])
        for n in range(ARM_QUANTITY_COUNT):
            store_state(arena, i, row.COLUMNS + length * (length + 1 + n), by_quantity[first + i, :, n])


TANGENTS = Program(
    "tangents",
    entry_points=(run_tangents,),
    groups=frozenset({"tangents"}),
    allocation_free=True,
    description="an arm driven by torques, and its Jacobians",
)
