"""Drivers of the torque-driven arm's kernel: the classical Runge-Kutta method over lanes, steps and blocks.

Assembled and compiled like `stepping`, which explains lanes, blocks and arenas.
"""

from __future__ import annotations

from typing import Any

LANES = 1
SIZE = 4  # internal coordinates
Y = V = TAU = 0

# The classical Runge-Kutta method of fourth order, for the torque-driven arm.
RK4_NODES = (0.0, 0.5, 0.5, 1.0)
RK4_WEIGHTS = (1.0, 2.0, 2.0, 1.0)  # in sixths of a step


def step_kernel(arena: Any, h: float, bases: Any = ()) -> None:
    """One step of the torque-driven arm on every lane, torques held (recorded).

    Args:
        arena: of one block.
        h: step [s].
        bases: see `drives.hermite`, at the step's start, middle and end; under the inner law only.
    """
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
            step_kernel(arena, h)
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
