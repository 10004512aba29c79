"""The driver that Python calls: one control period of every lane, of the paper's loop and of environments alike.

A period is the same for all simulators: the arms of a block move, lanes that start are put at their start, and what is
known at the end is reported. What moves them, where they start and what is reported are parts of the program (`act`,
`begin`, `report`): `loop` has those of the paper's loop, `flexarm_env.episode.step` those of environments. What the
parts have in common is below them, once: the delay line and its sensor (`delay_line`), the law (`imex`, `law`), the
reference (`reference`), the state's status (`status`). So the paper's loop knows no episode and no reward, and an
environment driven by the gain has its bits. `imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.arrays import Arena, Clock, History, LaneRow, Mask, Memory, Paths, Table, Words
from flexarm_env.codegen.declarations import chosen_by_program, inlined_in_its_caller
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.kernels.entries import CLOCK_ROWS, setting, word
from flexarm_env.kernels.law import start_law
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import variant


@chosen_by_program
def act(
    memory: Memory,
    arena: Arena,
    history: History,
    clock: Clock,
    paths: Paths,
    header: Words,
    settings: Table,
    first: int,
) -> None:
    """Move the arms of a block over a control period.

    Args:
        memory: of the batch, for the arrays that only some programs have.
        arena: of the block.
        history: readings at past steps.
        clock: of each lane.
        paths: of all lanes.
        header: see `entries.Header`.
        settings: see `entries.Setting`.
        first: lane of the block among all.
    """


@chosen_by_program
def begin(
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
    """Put the lanes of a block that start at their start, up to what is reported; the others stay as they are.

    Args: as `act`, and
        started: which lanes start. Shape (lanes,).
    """


@chosen_by_program
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
    """Write what is known of a block at the present instant; see `begin`."""


def step_blocks(memory: Memory, low: int, high: int, results: NDArray[np.float64]) -> None:
    """One control period of some blocks (`step_block`), and what is known at its end.

    Args:
        memory: of the batch.
        low: first block.
        high: block after the last.
        results: to be filled; the parts of `layout.result_sizes`. Shape (parts, lanes).
    """
    header = array_at(memory, 0, (word.PLACES,), np.int64)
    for block in range(low, high):
        step_block(memory, block)
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
def step_block(memory: Memory, block: int) -> None:
    """One control period of a block, unless `DRIVING` is 0; lanes that start do so at its end.

    So a lane that starts costs its block no second report. The caller forgets then which lanes started.

    Args:
        memory: of the batch; the header lies at its beginning, and says where the arrays of `entries.Word` are.
        block: which.
    """
    words = array_at(memory, word.HEADER_WORDS, (1,), np.int64)[0]
    header = array_at(memory, 0, (words,), np.int64)
    settings = array_at(memory, header[word.SETTINGS], (header[word.SETTING_NUMBERS],), np.float64)
    paths = array_at(memory, header[word.PATHS], (header[word.PATH_COUNT], header[word.PATH_POINTS], 5), np.float64)
    first = block * variant.lanes
    rows, readings = header[word.ARENA_ROWS], header[word.HISTORY_ROWS]
    arena: Arena = array_at(memory, header[word.ARENAS] + first * rows, (rows, variant.lanes), np.float64)
    history: History = array_at(
        memory, header[word.HISTORIES] + first * readings, (readings, variant.lanes), np.float64
    )
    clock = array_at(memory, header[word.CLOCKS] + first * CLOCK_ROWS, (CLOCK_ROWS, variant.lanes), np.int64)
    started = array_at(memory, header[word.STARTS], (first + variant.lanes,), np.bool_)[first:]
    driving, starting = header[word.DRIVING] != 0, False
    for i in range(variant.lanes):
        starting = starting or started[i]
    if not (driving or starting):
        return
    if driving:
        act(memory, arena, history, clock, paths, header, settings, first)
    if starting:
        begin(memory, arena, history, clock, paths, header, settings, first, started)
    report(memory, arena, history, clock, paths, header, settings, first, started)
    if variant.law:
        if starting:
            start_law(arena, history, clock, paths, settings[setting.STEP], started)
