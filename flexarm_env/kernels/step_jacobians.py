"""Jacobians of the torque-driven arm's state after some Runge-Kutta steps: recorded formulas and drivers.

`imex` explains lanes, blocks and arenas.

A step of the discrete method is differentiated, not the continuous motion. At each of its stages the derivatives of the
acceleration a with respect to positions, rates, torques and quantities solve

    M da = d(imbalance),

with one factorisation of M(y) for all of them (`dynamics.imbalance`); they are the stage's *slopes*. A *column* is the
derivative of the state, internal coordinates y and rates v, with respect to one input: a public coordinate or rate at
the start, a held torque, a quantity. Each is carried through the four stages of a step by products with the slopes.

The arm has no preferred direction: its acceleration depends on a1 and a2 through a2 - a1 alone, so there are slopes for
the positions a2, q1, q2 only, and the column of theta1 is a unit vector.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.arrays import Arena, LaneRows
from flexarm_env.codegen.declarations import Program
from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.tangents import tangents, varied
from flexarm_env.kernels.entries import constant
from flexarm_env.kernels.layout import row, slope_ways
from flexarm_env.kernels.recorded import step_kernel
from flexarm_env.kernels.recorder import Recorder, recorded_kernel
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
from flexarm_env.kernels.tableau import RK4_NODES, RK4_WEIGHTS
from flexarm_env.kernels.variants import Variant, variant
from flexarm_env.physics import dynamics as dyn
from flexarm_env.physics import linear_algebra
from flexarm_env.physics.constants import ARM_QUANTITIES, Constants, varied_constants
from flexarm_env.physics.linear_algebra import plus_scaled

Jacobians = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
STAGES = len(RK4_NODES)
QUANTITIES = len(ARM_QUANTITIES)


# --- recorded ---------------------------------------------------------------------------------------------------------


def stage_record(variant: Variant) -> Recorder:
    """Record one stage of a step: its acceleration, as `step_record` computes it, and the slopes."""
    r = Recorder(variant)
    ahead, weight = r.trace.input("ahead"), r.trace.input("weight")
    k, tau = r.constants(), r.read("TAU")
    y, v = plus_scaled(r.read("Y"), ahead, r.read("V_STAGE")), plus_scaled(r.read("V"), ahead, r.read("RATE_STAGE"))
    known = [*r.read("CONSTANTS"), *r.read("ELIMINATION")]
    rates = r.trace.call("slope", [*known, *y, *v, *tau, *sincos(dyn.elbow_turn(y))], len(v))
    total = plus_scaled(r.read("TOTAL"), weight, [*v, *rates])
    factors = linear_algebra.factor(dyn.mass_matrix(k, y, *stage_angles(variant, k, y)[:2]))
    ways = slope_ways(variant.modes)
    dual_y = [y[0], *varied(y[1:], [way for way in ways if way[0] == "y"])]
    dual_v, dual_tau = (varied(x, [way for way in ways if way[0] == name]) for x, name in ((v, "v"), (tau, "tau")))
    dual_k = varied_constants(k, r.constant_derivatives(), [way for way in ways if way[0] == "quantity"])
    angles = stage_angles(variant, dual_k, dual_y)
    off = dyn.imbalance(dual_k, variant.complete, dual_y, dual_v, rates, dual_tau, angles)
    for name, values in (("V_STAGE", v), ("RATE_STAGE", rates), ("TOTAL", total)):
        r.write(name, values)
    right = [[tangents(force).get(way, 0.0) for force in off] for way in ways]
    r.store("slopes", [change for force in right for change in linear_algebra.solve(factors, force)])
    return r


def stage_angles(variant: Variant, k: Constants, y: Sequence[Any]) -> tuple[Any, Any, Any]:
    """Cosine and sine of a2 - a1, and the sine of theta2 where it is used."""
    sin, cos = sincos(dyn.elbow_turn(y))
    return cos, sin, None if variant.complete else sincos(dyn.joint_angles(k, y)[1])[0]


def column_record(variant: Variant, with_input: bool = False) -> Recorder:
    """Record the classical Runge-Kutta method of the linear system of one column.

    Its accelerations A1 to A4 alone are computed: positions follow from them, since their rates are the rates v, as
    ``y + h v + h^2/6 (A1 + A2 + A3)``, and those of the stages likewise.

    Args:
        variant: of the kernels.
        with_input: the column is of an input that acts all the time: its own slopes are added at each stage.
    """
    r = Recorder(variant, inlining=True)
    m, size, ways = variant.modes, variant.size, variant.ways
    h, column = r.trace.input("h"), r.rows_of("column", 2 * size)
    y, v = column[:size], column[size:]
    half, quarter, sixth = 0.5 * h, 0.25 * (h * h), h / 6.0

    def acceleration(stage: int, stage_y: Sequence[Any], stage_v: Sequence[Any]) -> list[Any]:
        first = stage * ways * size
        slopes = r.rows_of("slopes", (2 * size - 1) * size, first)
        total = r.rows_of("input", size, first) if with_input else [0.0] * size
        moved = [*stage_y[1 : m + 1], stage_y[m + 1] - stage_y[0], *stage_y[m + 2 :], *stage_v]
        for n, change in enumerate(moved):
            total = [a + slopes[n * size + i] * change for i, a in enumerate(total)]
        return total

    middle, end = plus_scaled(y, half, v), plus_scaled(y, h, v)
    first = acceleration(0, y, v)
    second = acceleration(1, middle, plus_scaled(v, half, first))
    third = acceleration(2, plus_scaled(middle, quarter, first), plus_scaled(v, half, second))
    fourth = acceleration(3, plus_scaled(end, half * h, second), plus_scaled(v, h, third))
    inner = [a + b for a, b in zip(second, third, strict=True)]
    three = [a + b for a, b in zip(first, inner, strict=True)]
    all_six = [a + b + c for a, b, c in zip(three, inner, fourth, strict=True)]
    r.store("column", [*plus_scaled(end, sixth * h, three), *plus_scaled(v, sixth, all_six)])
    return r


def input_column_record(variant: Variant) -> Recorder:
    """`column_record` of an input that acts all the time."""
    return column_record(variant, with_input=True)


@recorded_kernel(stage_record)
def stage_kernel(arena: Arena, slopes: LaneRows, ahead: float, weight: float) -> None:
    """One stage of a step of every lane, and the slopes of its acceleration.

    Args:
        arena: of one block; rates and acceleration of the stage before in V_STAGE and RATE_STAGE, which receive the
            stage's own; TOTAL adds them up.
        slopes: receives the derivatives of the acceleration by each input (`slope_ways`). Shape (ways * size, lanes).
        ahead: time of the stage after the step's start [s].
        weight: of the stage in the step.
    """


def end_record(variant: Variant) -> Recorder:
    """Record the end of a step whose stages are added up."""
    r = Recorder(variant)
    moved = plus_scaled([*r.read("Y"), *r.read("V")], r.trace.input("h") / 6.0, r.read("TOTAL"))
    r.write("Y", moved[: variant.size])
    r.write("V", moved[variant.size :])
    return r


@recorded_kernel(end_record)
def end_kernel(arena: Arena, h: float) -> None:
    """Move every lane to the end of its step, from the sum of its stages; the bits are those of `step_kernel`."""


@recorded_kernel(column_record)
def column_kernel(column: LaneRows, slopes: LaneRows, h: float) -> None:
    """One column of every lane over a step.

    Args:
        column: before and after. Shape (2 * size, lanes).
        slopes: of all stages. Shape (stages * ways * size, lanes).
        h: step [s].
    """


@recorded_kernel(input_column_record)
def input_column_kernel(column: LaneRows, slopes: LaneRows, input: LaneRows, h: float) -> None:
    """One column of every lane over a step, of an input that acts all the time.

    Args:
        column: see `column_kernel`.
        slopes: see `column_kernel`.
        input: `slopes` from the first of this input on.
        h: step [s].
    """


# --- drivers ----------------------------------------------------------------------------------------------------------


def run_steps(arena: Arena, arms: ArmTable, torques: ArmTable, h: float, steps: int, states: States) -> None:
    """Advance many arms by the same number of steps, torques held.

    Args:
        arena: to work in.
        arms: what kernels know of each (`layout.arm_rows`), or of all. Shape (arms or 1, numbers).
        torques: Shape (arms, 2) [N m].
        h: step [s].
        steps: how many.
        states: before and after.
    """
    for first in range(0, states.shape[0], variant.lanes):
        load_arms(arena, row.CONSTANTS, arms, first)
        load_rows(arena, row.TAU, torques, first)
        load_states(arena, states, first)
        for _ in range(steps):
            step_kernel(arena, h)
        store_states(arena, states, first)


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
    """Advance many arms like `run_steps`, and give the Jacobians of their public states.

    Args:
        arena: to work in.
        arms: see `run_steps`.
        changes: derivatives of the constants by each quantity. Shape (arms or 1, quantities * constants).
        torques: see `run_steps`.
        h: step [s].
        steps: how many.
        states: see `run_steps`.
        jacobians: by states, by torques, by quantities. Shapes (arms, 2 * size, columns).
    """
    for first in range(0, states.shape[0], variant.lanes):
        load_arms(arena, row.CONSTANTS, arms, first)
        load_arms(arena, row.CHANGES, changes, first)
        load_rows(arena, row.TAU, torques, first)
        load_states(arena, states, first)
        start_columns(arena)
        for _ in range(steps):
            find_slopes(arena, h)
            carry_columns(arena, h)
            end_kernel(arena, h)
        store_states(arena, states, first)
        store_columns(arena, jacobians, first)


def find_slopes(arena: Arena, h: float) -> None:
    """Compute the slopes of all stages of the coming step, and the sum of the stages."""
    for r in range(variant.size):
        for i in range(variant.lanes):
            arena[row.V_STAGE + r, i] = 0.0
            arena[row.RATE_STAGE + r, i] = 0.0
            arena[row.TOTAL + r, i] = 0.0
            arena[row.TOTAL + variant.size + r, i] = 0.0
    for stage in range(STAGES):
        begin = row.SLOPES + stage * variant.ways * variant.size
        slopes: LaneRows = arena[begin : begin + variant.ways * variant.size]
        stage_kernel(arena, slopes, h * RK4_NODES[stage], RK4_WEIGHTS[stage])


def carry_columns(arena: Arena, h: float) -> None:
    """All columns over the coming step."""
    slopes: LaneRows = arena[row.SLOPES : row.SLOPES + STAGES * variant.ways * variant.size]
    for n in range(variant.ways):
        begin = row.COLUMNS + 2 * variant.size * n
        column: LaneRows = arena[begin : begin + 2 * variant.size]
        if n < 2 * variant.size - 1:
            column_kernel(column, slopes, h)
        else:
            acting: LaneRows = slopes[n * variant.size : STAGES * variant.ways * variant.size]
            input_column_kernel(column, slopes, acting, h)


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
        for n in range(QUANTITIES):
            store_state(arena, i, row.COLUMNS + length * (length + 1 + n), by_quantity[first + i, :, n])


TANGENTS = Program(
    "tangents",
    entry_points=(run_steps, run_tangents),
    groups=frozenset({"tangents"}),
    closed=True,
    words="an arm driven by torques, and its Jacobians",
)
