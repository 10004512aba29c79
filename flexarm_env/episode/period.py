"""The driver that Python calls: one control period of every lane.

First the arms of a block move, and lanes that begin an episode are put at their start; then the sensors measure, and
observation, reward and status are written. Between these halves a host moves a plant of its own (`step.step_half`).
`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.arrays import Arena, Clock, History, LaneRow, Mask, Memory, Paths, Table, Words
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.codegen.rows import lane_rows
from flexarm_env.episode.actuation import drive
from flexarm_env.episode.first_readings import begin_sensors
from flexarm_env.episode.observe import observe, push_actions
from flexarm_env.episode.reset import reset_lanes
from flexarm_env.kernels.delay_line import fill_history, store_reading
from flexarm_env.kernels.entries import CLOCK_ROWS, clock_row, setting, word
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
    header = array_at(memory, 0, (word.PLACES,), np.int64)
    for block in range(low, high):
        step_block(memory, block, True, True)
        rows, first = header[word.ARENA_ROWS], block * variant.lanes
        arena: Arena = lane_rows(
            array_at(memory, header[word.ARENAS] + first * rows, (rows, variant.lanes), np.float64), variant.lanes
        )
        started = array_at(memory, header[word.STARTS], (first + variant.lanes,), np.bool_)[first:]
        for at in range(results.shape[0]):
            known: LaneRow = arena[row.STATE + at]
            output = results[at, first : first + variant.lanes]
            for i in range(variant.lanes):
                output[i] = known[i]
        for i in range(variant.lanes):
            started[i] = False


def step_block(memory: Memory, block: int, deciding: bool, observing: bool) -> None:
    """Advance a block by one control period, unless `DRIVING` is 0, and then begin the episodes that are to begin.

    One measurement at the end serves both kinds of lanes. The caller clears the marks of the lanes that started.

    Args:
        memory: of the batch; its header comes first and has the places of the arrays (`entries.Word`).
        block: index of the block.
        deciding: whether to do the first half.
        observing: whether to do the second half.
    """
    words = array_at(memory, word.HEADER_WORDS, (1,), np.int64)[0]
    header = array_at(memory, 0, (words,), np.int64)
    settings = array_at(memory, header[word.SETTINGS], (header[word.SETTING_NUMBERS],), np.float64)
    paths = array_at(memory, header[word.PATHS], (header[word.PATH_COUNT], header[word.PATH_POINTS], 5), np.float64)
    first = block * variant.lanes
    rows, readings = header[word.ARENA_ROWS], header[word.HISTORY_ROWS]
    arena: Arena = lane_rows(
        array_at(memory, header[word.ARENAS] + first * rows, (rows, variant.lanes), np.float64), variant.lanes
    )
    history: History = lane_rows(
        array_at(memory, header[word.HISTORIES] + first * readings, (readings, variant.lanes), np.float64),
        variant.lanes,
    )
    clock = array_at(memory, header[word.CLOCKS] + first * CLOCK_ROWS, (CLOCK_ROWS, variant.lanes), np.int64)
    started = array_at(memory, header[word.STARTS], (first + variant.lanes,), np.bool_)[first:]
    driving, starting = header[word.DRIVING] != 0, False
    for i in range(variant.lanes):
        starting = starting or started[i]
    if not (driving or starting):
        return
    if driving and deciding:
        actions = array_at(memory, header[word.ACTIONS], (first + variant.lanes, header[word.CHANNELS]), np.float32)
        push_actions(arena, actions, first, header)
        drive(arena, history, clock, paths, header, settings)
    if starting and deciding:
        reset_lanes(memory, arena, clock, paths, header, settings, first, started)
    if not observing:
        return
    if starting:
        if not variant.hosted:
            # for lanes that go on, the reading is already there, or no sensor reads this slot
            store_reading(arena, history, clock[clock_row.HEAD, 0])
        for i in range(variant.lanes):
            if started[i]:
                fill_history(history, clock, header, i)
    report(memory, arena, history, clock, paths, header, settings, first, started)
    if variant.law:
        if starting:
            start_law(arena, history, clock, paths, settings[setting.STEP], started)


def report(
    memory: Memory,
    arena: Arena,
    history: History,
    clock: Clock,
    paths: Paths,
    header: Words,
    settings: Table,
    first: int,
    started: Mask,
) -> None:
    """Observe the lanes of a block, or those that begin an episode.

    Args:
        memory: of the batch.
        arena: of the block.
        history: readings at past steps.
        clock: of each lane.
        paths: of all lanes.
        header: see `entries.Header`.
        settings: see `entries.Setting`.
        first: lane of the block among all.
        started: lanes that begin an episode. Shape (lanes,).
    """
    lanes = first + variant.lanes
    keys = array_at(memory, header[word.KEYS], (lanes,), np.uint64)[first:]
    active = array_at(memory, header[word.ACTIVE], (lanes,), np.bool_)[first:]
    observations = array_at(memory, header[word.OBSERVATIONS], (lanes, header[word.OBSERVED]), np.float32)
    starting = False
    for i in range(variant.lanes):
        starting = starting or started[i]
        active[i] = header[word.DRIVING] != 0 or started[i]
    if starting:
        begin_sensors(arena, history, clock, keys, paths, header, settings, started)
    observe(arena, history, clock, keys, paths, header, settings, observations, first, active)
    for i in range(variant.lanes if starting else 0):
        if started[i]:  # a reset has no reward
            for n in range(variant.reward_terms):
                arena[row.REWARD_TERMS + n, i] = 0.0
            arena[row.REWARD, i] = 0.0
