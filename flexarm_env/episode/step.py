"""The entry points that Python calls: one control period of a batch or of one environment; and the programs.

`imex` explains lanes, blocks and arenas. A control period has two halves: what is decided (actions, what they command,
where an episode starts), and what is observed: observation, reward and status. In between the arm moves: our own within
the first half, by `drive`; another plant by its host, which calls the halves one by one (`step_half`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.arrays import LaneRow, Memory
from flexarm_env.codegen.declarations import Function, Program
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.episode import reward
from flexarm_env.episode.actuation import DRIVES, HOST_DRIVES, Drive, drive
from flexarm_env.episode.observe import push_actions, update_measurements, write_observations, write_previews
from flexarm_env.episode.reset import begin_sensors, reset_lanes
from flexarm_env.kernels.delay_line import fill_history, store_reading
from flexarm_env.kernels.entries import clock_row, setting, word
from flexarm_env.kernels.imex import start_law
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import Block, block_at, variant


def step_blocks(memory: Memory, low: int, high: int, results: NDArray[np.float64]) -> None:
    """Advance some blocks by one control period (`step_block`), and copy their results.

    Args:
        memory: of the batch.
        low: first block.
        high: block after the last.
        results: output; a row for each number of `layout.result_sizes`. Shape (k, lanes of all blocks).
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
    update_measurements(block)
    write_previews(block)
    write_observations(block, observations)
    for i in range(variant.lanes if starting else 0):
        if started[i]:  # a reset has no reward
            for n in range(variant.reward_terms):
                arena[row.REWARD_TERMS + n, i] = 0.0
            arena[row.REWARD, i] = 0.0


def step_only(memory: Memory) -> bool:
    """Advance a single environment by one control period, or begin its episode (`step_block`).

    Args:
        memory: of the batch.

    Returns:
        False if an action is not finite, unless an episode begins; the state is then unchanged.
    """
    if not is_acceptable(memory):
        return False
    step_block(memory, 0, True, True)
    clear_reset_flag(memory)
    return True


def step_half(memory: Memory, moved: bool) -> bool:
    """One half of `step_only`, of the only environment whose plant another engine advances.

    After the first half the commands of each integration step lie in the arena's tail (`actuation.host_commands`), or
    the state in which the plant begins in Y and V. Before the second half the host enters what the plant reads and is:
    the delay line's slots, and the rows that `truth_kernel` computes of our own arm.

    Args:
        memory: of the batch.
        moved: whether the plant is where the period ends; the second half.

    Returns:
        Whether it was done: an action that is not finite is refused, unless an episode begins.
    """
    if not (moved or is_acceptable(memory)):
        return False
    step_block(memory, 0, not moved, moved)
    if moved:
        clear_reset_flag(memory)
    return True


def is_acceptable(memory: Memory) -> bool:
    """Return whether the only environment's action is finite, or an episode begins, which does not read it."""
    header = array_at(memory, 0, (word.PLACES,), np.int64)
    channels = header[word.CHANNELS]
    actions = array_at(memory, header[word.ACTIONS], (channels,), np.float32)
    starting = array_at(memory, header[word.STARTS], (1,), np.bool_)[0]
    for r in range(channels if header[word.DRIVING] != 0 and not starting else 0):
        if actions[r] - actions[r] != 0.0:
            return False
    return True


def clear_reset_flag(memory: Memory) -> None:
    """Note that the only environment's episode has begun."""
    header = array_at(memory, 0, (word.PLACES,), np.int64)
    array_at(memory, header[word.STARTS], (1,), np.bool_)[0] = False


def _program(name: str, one: Drive, alone: Function, *groups: str) -> Program:
    return Program(
        name,
        entry_points=(step_blocks,),
        single_entry_points=(alone,),
        groups=frozenset({"environment", *one.groups, *groups}),
        hooks={"drive": one.driver},
        reward_terms=len(reward.TERMS) - (0 if "race" in one.groups else len(reward.OF_RACES)),
        allocation_free=True,
        description=one.description,
    )


# The programs of environments, by name; each has one of the ways in which an action moves the arm.
PROGRAMS = {name: _program(name, one, step_only) for name, one in DRIVES.items()}
# Those of environments whose plant another engine advances, by the same names (`step_half`).
HOST_PROGRAMS = {name: _program(f"hosted_{name}", one, step_half, "hosted") for name, one in HOST_DRIVES.items()}
TORQUE, TRACKING, GAIN = (PROGRAMS[name] for name in ("torque", "tracking", "gain"))
