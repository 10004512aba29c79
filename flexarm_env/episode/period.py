"""The driver that Python calls: one control period of every lane.

First the arms of a block move, and lanes that begin an episode are put at their start; then the sensors measure, and
observation, reward and status are written. Between these halves a host moves a plant of its own (`step.step_half`).
`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.arrays import LaneRow, Memory
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.episode.actuation import drive
from flexarm_env.episode.first_readings import begin_sensors
from flexarm_env.episode.observe import observe, push_actions
from flexarm_env.episode.reset import reset_lanes
from flexarm_env.kernels.block import Block, block_at
from flexarm_env.kernels.delay_line import fill_history, store_reading
from flexarm_env.kernels.entries import clock_row, setting, word
from flexarm_env.kernels.law import start_law
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import variant


def step_blocks(memory: Memory, low: int, high: int, results: NDArray[np.float64]) -> None:
    """Advance some blocks by one control period (`step_block`), and copy their results.

    Args:
        memory: of the batch.
        low: first block.
        high: block after the last.
        results: output; the parts of `layout.result_sizes`. Shape (parts, lanes).
    """
    for number in range(low, high):
        step_block(memory, number, True, True)
        block = block_at(memory, number)
        arena, started = block.arena, block.started
        for at in range(results.shape[0]):
            known: LaneRow = arena[row.STATE + at]
            output = results[at, block.first : block.first + variant.lanes]
            for i in range(variant.lanes):
                output[i] = known[i]
        for i in range(variant.lanes):
            started[i] = False


def step_block(memory: Memory, number: int, deciding: bool, observing: bool) -> None:
    """Advance a block by one control period, unless `DRIVING` is 0, and then begin the episodes that are to begin.

    One measurement at the end serves both kinds of lanes. The caller clears the marks of the lanes that started.

    Args:
        memory: of the batch.
        number: of the block.
        deciding: whether to do the first half.
        observing: whether to do the second half.
    """
    block = block_at(memory, number)
    header, started = block.header, block.started
    driving, starting = header[word.DRIVING] != 0, False
    for i in range(variant.lanes):
        starting = starting or started[i]
    if not (driving or starting):
        return
    if driving and deciding:
        shape = (block.first + variant.lanes, header[word.CHANNELS])
        actions = array_at(memory, header[word.ACTIONS], shape, np.float32)
        push_actions(block, actions)
        drive(block)
    if starting and deciding:
        reset_lanes(block)
    if not observing:
        return
    if starting:
        if not variant.hosted:
            # for lanes that go on, the reading is already there, or no sensor reads this slot
            store_reading(block.arena, block.history, block.clock[clock_row.HEAD, 0])
        for i in range(variant.lanes):
            if started[i]:
                fill_history(block, i)
    report(block)
    if variant.law:
        if starting:
            start_law(block, block.settings[setting.STEP])


def report(block: Block) -> None:
    """Observe the lanes of a block, or those that begin an episode."""
    header, arena, started, active = block.header, block.arena, block.started, block.active
    shape = (block.first + variant.lanes, header[word.OBSERVED])
    observations = array_at(block.memory, header[word.OBSERVATIONS], shape, np.float32)
    starting = False
    for i in range(variant.lanes):
        starting = starting or started[i]
        active[i] = header[word.DRIVING] != 0 or started[i]
    if starting:
        begin_sensors(block)
    observe(block, observations)
    for i in range(variant.lanes if starting else 0):
        if started[i]:  # a reset has no reward
            for n in range(variant.reward_terms):
                arena[row.REWARD_TERMS + n, i] = 0.0
            arena[row.REWARD, i] = 0.0
