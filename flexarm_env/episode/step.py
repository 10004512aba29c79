"""Entry points of the environments' kernels: resets, and one control period of one environment or of a batch.

`imex` explains lanes, blocks and arenas. A control period has two halves: what is decided (actions, what they command,
where an episode starts), and what is observed. In between the arm moves: our own within the first half, by `drive`;
another plant by its host, which calls the halves one by one (`step_half`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.arrays import Arena, History, LaneRow, Memory
from flexarm_env.codegen.declarations import Function, Program, inlined_in_its_caller
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.episode import reward
from flexarm_env.episode.actuation import DRIVES, HOST_DRIVES, Drive, drive
from flexarm_env.episode.observe import observe, take_actions
from flexarm_env.episode.reset import begin_sensors, reset_lanes, start_law
from flexarm_env.kernels.entries import CLOCK_ROWS, setting, word
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import variant


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
    forget_start(memory)
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
        forget_start(memory)
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


def forget_start(memory: Memory) -> None:
    """Note that the only environment's episode has begun."""
    header = array_at(memory, 0, (word.PLACES,), np.int64)
    array_at(memory, header[word.STARTS], (1,), np.bool_)[0] = False


def step_blocks(memory: Memory, begin: int, end: int, results: NDArray[np.float64]) -> None:
    """Advance some blocks by one control period (`step_block`), and copy their results.

    Args:
        memory: of the batch.
        begin: first block.
        end: block after the last.
        results: output; the parts of `layout.episode_sizes`. Shape (parts, lanes).
    """
    header = array_at(memory, 0, (word.PLACES,), np.int64)
    for block in range(begin, end):
        step_block(memory, block, True, True)
        rows, first = header[word.ARENA_ROWS], block * variant.lanes
        arena: Arena = array_at(memory, header[word.ARENAS] + first * rows, (rows, variant.lanes), np.float64)
        started = array_at(memory, header[word.STARTS], (first + variant.lanes,), np.bool_)[first:]
        for at in range(results.shape[0]):
            known: LaneRow = arena[row.STATE + at]
            told = results[at, first : first + variant.lanes]
            for i in range(variant.lanes):
                told[i] = known[i]
        for i in range(variant.lanes):
            started[i] = False


@inlined_in_its_caller
def step_block(memory: Memory, block: int, deciding: bool, observing: bool) -> None:
    """Advance a block by one control period, unless `DRIVING` is 0, and then begin the requested episodes.

    One measurement at the end serves both kinds of lanes. The caller clears the requests afterwards.

    Args:
        memory: of the batch; its header comes first and has the places of the arrays (`entries.Word`).
        block: index of the block.
        deciding: whether to do the first half.
        observing: whether to do the second half.
    """
    observed = array_at(memory, word.OBSERVED, (1,), np.int64)[0]
    header = array_at(memory, 0, (word.PLACES + observed,), np.int64)
    numbers = setting.HORIZONS + header[word.PREVIEWS] + observed
    settings = array_at(memory, header[word.SETTINGS], (numbers,), np.float64)
    paths = array_at(memory, header[word.PATHS], (header[word.PATH_COUNT], header[word.PATH_POINTS], 5), np.float64)
    first = block * variant.lanes
    rows, readings = header[word.ARENA_ROWS], header[word.HISTORY_ROWS]
    arena: Arena = array_at(memory, header[word.ARENAS] + first * rows, (rows, variant.lanes), np.float64)
    history: History = array_at(
        memory, header[word.HISTORIES] + first * readings, (readings, variant.lanes), np.float64
    )
    clock = array_at(memory, header[word.CLOCKS] + first * CLOCK_ROWS, (CLOCK_ROWS, variant.lanes), np.int64)
    lanes = first + variant.lanes  # the arrays of all lanes, up to these
    key = array_at(memory, header[word.KEYS], (lanes,), np.uint64)[first:]
    started = array_at(memory, header[word.STARTS], (lanes,), np.bool_)[first:]
    active = array_at(memory, header[word.ACTIVE], (lanes,), np.bool_)[first:]
    reset_requests = array_at(memory, header[word.RESET_REQUESTS], (lanes, header[word.ORDER_COLUMNS]), np.float64)
    columns = header[word.LANE_SETTING_COLUMNS]
    owns = array_at(memory, header[word.LANE_SETTINGS], (header[word.LANE_SETTING_ROWS], columns), np.float64)
    observations = array_at(memory, header[word.OBSERVATIONS], (lanes, observed), np.float32)
    driving, starting = header[word.DRIVING] != 0, False
    for i in range(variant.lanes):
        starting = starting or started[i]
    if not (driving or starting):
        return
    if driving and deciding:
        actions = array_at(memory, header[word.ACTIONS], (lanes, header[word.CHANNELS]), np.float32)
        take_actions(arena, actions, first, header)
        drive(arena, history, clock, paths, header, settings)
    if starting and deciding:
        reset_lanes(arena, clock, key, paths, header, settings, owns, reset_requests, first, started)
    if not observing:
        return
    if starting:
        begin_sensors(arena, history, clock, paths, header, settings, started)
    for i in range(variant.lanes):
        active[i] = driving or started[i]
    observe(arena, history, clock, key, paths, header, settings, observations, first, active)
    if starting:
        if variant.law:
            start_law(arena, history, clock, paths, settings, started)
        for i in range(variant.lanes):
            if started[i]:  # a reset has no reward
                for n in range(variant.reward_terms):
                    arena[row.REWARD_TERMS + n, i] = 0.0
                arena[row.REWARD, i] = 0.0


def _program(name: str, one: Drive, alone: Function, *groups: str) -> Program:
    return Program(
        name,
        entry_points=(step_blocks,),
        alone=(alone,),
        groups=frozenset({"environment", *one.groups, *groups}),
        parts={"drive": one.driver},
        reward_terms=len(reward.TERMS),
        closed=True,
        words=one.words,
    )


# The programs of environments, by name; each has one of the ways in which an action moves the arm.
PROGRAMS = {name: _program(name, one, step_only) for name, one in DRIVES.items()}
# Those of environments whose plant another engine advances, by the same names (`step_half`).
HOST_PROGRAMS = {name: _program(f"hosted_{name}", one, step_half, "hosted") for name, one in HOST_DRIVES.items()}
TORQUE, TRACKING, GAIN = (PROGRAMS[name] for name in ("torque", "tracking", "gain"))
