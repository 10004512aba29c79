"""Drivers between public states and the internal ones (`dynamics.internal_coordinates`)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.arrays import Arena
from flexarm_env.kernels.entries import constant
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import variant

ArmTable = NDArray[np.float64]  # numbers of each arm, or of all in one row. Shape (arms or 1, n)
States = NDArray[np.float64]  # public. Shape (arms, 2 * size)


def internal_place(entry: int) -> int:
    """Return where an entry of (theta1, theta2, q1, q2) lies in (a1, q1, a2, q2); theta2's place is that of a2."""
    if entry == 0:
        return 0
    if entry == 1:
        return variant.modes + 1
    return entry - 1 if entry < variant.modes + 2 else entry


def elbow_slope(arena: Arena, i: int, first_row: int) -> float:
    """Return the angle of link 1's tip against its root in lane i, or the rate of it.

    Args:
        arena: of one block.
        i: the lane.
        first_row: of link 1's modal coordinates, or of their rates.
    """
    slope = 0.0
    for n in range(variant.modes):
        slope += arena[row.CONSTANTS + constant.ELBOW_SLOPES + n, i] * arena[first_row + n, i]
    return slope


def enter_state(arena: Arena, i: int) -> None:
    """Put lane i into the public state of the rows `Row.STATE`."""
    for part in range(2):
        begin, public = row.Y + part * variant.size, row.STATE + part * variant.size
        for entry in range(variant.size):
            arena[begin + internal_place(entry), i] = arena[public + entry, i]
        turn_link_2(arena, i, begin)


def turn_link_2(arena: Arena, i: int, begin: int) -> None:
    """Replace theta2 of lane i, in coordinates or rates from a row on, by the absolute angle a2 or its rate."""
    at = begin + variant.modes + 1
    arena[at, i] = arena[begin, i] + elbow_slope(arena, i, begin + 1) + arena[at, i]


def load_rows(arena: Arena, first_row: int, table: ArmTable, first: int) -> None:
    """Copy numbers of some arms into a block; the lanes after the last arm repeat it.

    Args:
        arena: of one block.
        first_row: of the arena, to begin with.
        table: of all arms.
        first: arm of lane 0.
    """
    for i in range(variant.lanes):
        arm = min(first + i, table.shape[0] - 1)
        for n in range(table.shape[1]):
            arena[first_row + n, i] = table[arm, n]


def load_arms(arena: Arena, first_row: int, table: ArmTable, first: int) -> None:
    """As `load_rows`, of what no step changes; a table of one row serves all blocks."""
    if first == 0 or table.shape[0] > 1:
        load_rows(arena, first_row, table, first)


def load_states(arena: Arena, states: States, first: int) -> None:
    """Copy public states into a block, as internal ones (`dynamics.internal_coordinates`)."""
    for i in range(variant.lanes):
        state = states[min(first + i, states.shape[0] - 1)]
        for part in range(2):
            begin = row.Y + part * variant.size
            entry = part * variant.size
            for n in range(variant.size):
                arena[begin + internal_place(n), i] = state[entry + n]
            turn_link_2(arena, i, begin)


def store_state(arena: Arena, i: int, first_row: int, state: NDArray[np.float64]) -> None:
    """Copy an internal state of lane i out, as a public one (`dynamics.public_coordinates`).

    Args:
        arena: of one block.
        i: the lane.
        first_row: of the internal state.
        state: receives it. Shape (2 * size,).
    """
    for part in range(2):
        begin = first_row + part * variant.size
        entry = part * variant.size
        state[entry] = arena[begin, i]
        state[entry + 1] = arena[begin + variant.modes + 1, i] - arena[begin, i] - elbow_slope(arena, i, begin + 1)
        for n in range(variant.modes):
            state[entry + 2 + n] = arena[begin + 1 + n, i]
            state[entry + 2 + variant.modes + n] = arena[begin + variant.modes + 2 + n, i]


def store_states(arena: Arena, states: States, first: int) -> None:
    """Copy the states of a block out."""
    for i in range(min(variant.lanes, states.shape[0] - first)):
        store_state(arena, i, row.Y, states[first + i])
