"""Drivers of the torque-driven arm's kernel: the classical Runge-Kutta method over lanes, steps and blocks.

Assembled and compiled like `stepping`, which explains lanes, blocks and arenas.
"""

from __future__ import annotations

from typing import Any

LANES = 1
SIZE = 4  # internal coordinates
Y = V = TAU = Y_SLOPE = V_SLOPE = Y_SUM = V_SUM = 0

# The classical Runge-Kutta method of fourth order, for the torque-driven arm.
RK4_STEP = (0.0, 0.5, 0.5, 1.0)
RK4_WEIGHT = (1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0)


def slope_kernel(arena: Any, step: float, weight: float) -> None:
    """One explicit Runge-Kutta stage of the torque-driven arm on every lane (recorded)."""
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def run_open(arenas: Any, torques: Any, states: Any, h: float, every: int) -> int:
    """Drive all blocks by torques held over each step, and record states.

    Args:
        arenas: Shape (blocks, rows * LANES).
        torques: Shape (steps, blocks, 2 * LANES) [N m].
        states: receives y and v after each `every` steps. Shape (steps // every, blocks, 2 * SIZE * LANES).
        h: step [s].
        every: record after so many steps.

    Returns:
        How many steps were done: fewer than asked if a state stopped being finite.
    """
    for step in range(torques.shape[0]):
        total = 0.0
        for block in range(arenas.shape[0]):
            arena = arenas[block]
            for r in range(2):
                for i in range(LANES):
                    arena[i + (TAU + r) * LANES] = torques[step, block, i + r * LANES]
            open_step(arena, h)
            for r in range(SIZE):
                for i in range(LANES):
                    total += arena[i + (Y + r) * LANES] + arena[i + (V + r) * LANES]
            if (step + 1) % every == 0:
                for r in range(SIZE):
                    for i in range(LANES):
                        states[step // every, block, i + r * LANES] = arena[i + (Y + r) * LANES]
                        states[step // every, block, i + (SIZE + r) * LANES] = arena[i + (V + r) * LANES]
        if total - total != 0.0:
            return step
    return torques.shape[0]


def open_step(arena: Any, h: float) -> None:
    """One classical Runge-Kutta step of the torque-driven arm on every lane of a block, torques held."""
    begin_step(arena)
    for stage in range(4):
        slope_kernel(arena, h * RK4_STEP[stage], RK4_WEIGHT[stage])
    end_step(arena, h)


def begin_step(arena: Any) -> None:
    """Clear slopes and their weighted sums."""
    for r in range(SIZE):
        for i in range(LANES):
            arena[i + (Y_SLOPE + r) * LANES] = 0.0
            arena[i + (V_SLOPE + r) * LANES] = 0.0
            arena[i + (Y_SUM + r) * LANES] = 0.0
            arena[i + (V_SUM + r) * LANES] = 0.0


def end_step(arena: Any, h: float) -> None:
    """Advance the state by the weighted sum of slopes."""
    for r in range(SIZE):
        for i in range(LANES):
            arena[i + (Y + r) * LANES] += h * arena[i + (Y_SUM + r) * LANES]
            arena[i + (V + r) * LANES] += h * arena[i + (V_SUM + r) * LANES]
