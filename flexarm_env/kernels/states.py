"""Drivers between public and internal states (`dynamics.internal_coordinates`) of one lane."""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena
from flexarm_env.kernels.entries import constant
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import variant


def internal_place(entry: int) -> int:
    """Place among the internal coordinates (a1, q1, a2, q2) of an entry of the public ones (theta1, theta2, q1, q2)."""
    if entry == 0:
        return 0
    if entry == 1:
        return variant.modes + 1
    return entry - 1 if entry < variant.modes + 2 else entry


def elbow_slope(arena: Arena, i: int, first_row: int) -> float:
    """Angle of link 1's tip against its root in lane i.

    Args:
        arena: of one block.
        i: the lane.
        first_row: of link 1's modal coordinates.
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
