"""Drivers that start the tip law: its delays, and the implicit integrator's first stage.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena
from flexarm_env.kernels.block import Block
from flexarm_env.kernels.delay_line import prepare_readings
from flexarm_env.kernels.imex import prepare_commands
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.path_cache import invalidate_segment
from flexarm_env.kernels.recorded import law_kernel
from flexarm_env.kernels.tableau import STAGES
from flexarm_env.kernels.variants import variant


def prepare_law(arena: Arena, i: int) -> None:
    """Set the delays and weights of the tip law in lane i, and the gain 0."""
    for r in range(2):
        late = arena[row.SENSOR_DELAY + r, i] if variant.law_on_sensor else 0.0
        shared = arena[row.SENSOR_DELAY, i]
        compensation = arena[row.COMPENSATION, i]
        command = 0.0 if compensation == 0.0 else shared if compensation == 1.0 else late
        arena[row.DELAY + r, i] = late
        arena[row.COMMAND_DELAY + r, i] = command
        arena[row.WEIGHT + r, i] = 1.0
        arena[row.RATE_WEIGHT + r, i] = 1.0
    arena[row.GAIN, i] = 0.0
    invalidate_segment(arena, row.COMMAND_SEGMENT, i)


def start_law(block: Block, h: float) -> None:
    """Initialise the started lanes for the implicit integrator; the other lanes do not change.

    Args:
        block: the block.
        h: step [s].
    """
    arena, started = block.arena, block.started
    for at in range(STAGES * variant.size):  # an earlier run may have left numbers that are not finite
        for i in range(variant.lanes):
            if started[i]:
                arena[row.V_SLOTS + at, i] = 0.0
                arena[row.MECHANICAL_SLOTS + at, i] = 0.0
                arena[row.FEEDBACK_SLOTS + at, i] = 0.0
    # as `evaluate_law`, but the other lanes keep the torques of the start of their period
    prepare_commands(block, h)
    prepare_readings(block, h, 0.0)
    law_kernel(arena, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    for r in range(variant.size):
        for i in range(variant.lanes):
            if started[i]:
                arena[row.V_SLOTS + r, i] = arena[row.V_STAGE + r, i]
                arena[row.MECHANICAL_SLOTS + r, i] = arena[row.MECHANICAL + r, i]
                arena[row.FEEDBACK_SLOTS + r, i] = arena[row.FEEDBACK + r, i]
