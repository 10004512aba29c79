"""Drivers of the torque-driven arm's kernel: the classical Runge-Kutta method over lanes, steps and blocks.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena, Arenas, LaneRecords, LaneRows
from flexarm_env.codegen.declarations import Program
from flexarm_env.codegen.rows import lane_rows
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.recorded import momentum_kernel, slope_kernel, step_kernel
from flexarm_env.kernels.variants import variant


def run_open(arenas: Arenas, torques: LaneRecords, states: LaneRecords, h: float, every: int) -> int:
    """Drive all blocks by torques held over each step, and record states.

    Args:
        arenas: Shape (blocks, rows * lanes).
        torques: [N m]. Shape (steps, blocks, 2 * lanes).
        states: receives y and v after each `every` steps. Shape (steps // every, blocks, 2 * size * lanes).
        h: step [s].
        every: record after so many steps.

    Returns:
        How many steps were done: fewer than `steps` if a state stopped being finite.
    """
    for step in range(torques.shape[0]):
        total = 0.0
        for block in range(arenas.shape[0]):
            arena: Arena = lane_rows(arenas[block], variant.lanes)
            if step == 0:
                momentum_kernel(arena)
            held: LaneRows = lane_rows(torques[step, block], variant.lanes)
            for r in range(2):
                for i in range(variant.lanes):
                    arena[row.TAU + r, i] = held[r, i]
            step_kernel(arena, h)
            for r in range(variant.size):
                for i in range(variant.lanes):
                    total += arena[row.Y + r, i] + arena[row.V + r, i]
            if (step + 1) % every == 0:
                state: LaneRows = lane_rows(states[step // every, block], variant.lanes)
                for r in range(variant.size):
                    for i in range(variant.lanes):
                        state[r, i] = arena[row.Y + r, i]
                        state[variant.size + r, i] = arena[row.V + r, i]
        if total - total != 0.0:
            return step
    return torques.shape[0]


def find_momenta(arena: Arena) -> None:
    """Momenta of a block's arms, and their rates without the motors' part; see `momentum_kernel`."""
    momentum_kernel(lane_rows(arena, variant.lanes))


def find_slopes(arena: Arena) -> None:
    """Rates of a block's arms, and those of their momenta; see `slope_kernel`."""
    slope_kernel(lane_rows(arena, variant.lanes))


OPEN = Program("open", entry_points=(run_open, find_momenta, find_slopes), words="an arm driven by torques")
