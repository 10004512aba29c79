"""The driver that Python calls: one control period of every lane, of the paper's loop and of environments alike.

A period is the same for all simulators. First the arms of a block move, and lanes that start are put at their start;
then what is known is measured and reported. (Between these halves a host moves a plant of its own.) What moves the
arms, where they start and what is reported are parts of the program (`act`, `begin`, `report`): `loop` has those of the
paper's loop, `flexarm_env.episode.step` those of environments. What the parts have in common is below them, once: the
delay line and its sensor (`delay_line`), the law (`imex`, `law`), the reference (`reference`), the state's status
(`status`). So the paper's loop needs no episode and no reward, and has the bits of an environment driven by the gain.
`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.arrays import Arena, Clock, History, LaneRow, Mask, Memory, Paths, Table, Words
from flexarm_env.codegen.declarations import chosen_by_program, inlined_in_its_caller
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.kernels.delay_line import fill_history, store_reading
from flexarm_env.kernels.entries import CLOCK_ROWS, clock_row, setting, word
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
    """Put the lanes of a block that start at their start; the others do not change.

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
    """Measure and write what is known of a block at the present instant; see `begin`.

    The delay lines of lanes that start are filled as of arms that rested before.
    """


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
    """Advance a block by one control period, unless `DRIVING` is 0, and then start the lanes that are to start.

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
    if driving and deciding:
        act(memory, arena, history, clock, paths, header, settings, first)
    if starting and deciding:
        begin(memory, arena, history, clock, paths, header, settings, first, started)
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
