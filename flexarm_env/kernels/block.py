"""A block of lanes, as drivers take it: views of the memory of a batch (`codegen.memory`)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexarm_env.codegen.arrays import Arena, Clock, History, Keys, Mask, Memory, Paths, Table, Words
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.codegen.rows import lane_rows
from flexarm_env.kernels.entries import CLOCK_ROWS, word
from flexarm_env.kernels.variants import variant


class Block(NamedTuple):
    """Some environments, its lanes.

    Attributes:
        memory: of the batch.
        first: lane of the block among all.
        header: see `entries.Header`.
        settings: see `entries.Setting`.
        arena: all that is known of the lanes (`layout.Row`).
        history: readings at past steps (`delay_line`).
        clock: of each lane (`entries.ClockRow`).
        paths: of all lanes.
        started: lanes that begin an episode.
        keys: of the lanes' episodes.
        active: lanes that observe.
    """

    memory: Memory
    first: int
    header: Words
    settings: Table
    arena: Arena
    history: History
    clock: Clock
    paths: Paths
    started: Mask
    keys: Keys
    active: Mask


def block_at(memory: Memory, number: int) -> Block:
    """Return a block of a batch; the header, which comes first, has the places of the arrays (`entries.Word`)."""
    words = array_at(memory, word.HEADER_WORDS, (1,), np.int64)[0]
    header = array_at(memory, 0, (words,), np.int64)
    first, lanes = number * variant.lanes, variant.lanes
    rows, readings = header[word.ARENA_ROWS], header[word.HISTORY_ROWS]
    paths = (header[word.PATH_COUNT], header[word.PATH_POINTS], 5)
    return Block(
        memory,
        first,
        header,
        array_at(memory, header[word.SETTINGS], (header[word.SETTING_NUMBERS],), np.float64),
        lane_rows(array_at(memory, header[word.ARENAS] + first * rows, (rows, lanes), np.float64), variant.lanes),
        lane_rows(
            array_at(memory, header[word.HISTORIES] + first * readings, (readings, lanes), np.float64), variant.lanes
        ),
        array_at(memory, header[word.CLOCKS] + first * CLOCK_ROWS, (CLOCK_ROWS, lanes), np.int64),
        array_at(memory, header[word.PATHS], paths, np.float64),
        array_at(memory, header[word.STARTS], (first + lanes,), np.bool_)[first:],
        array_at(memory, header[word.KEYS], (first + lanes,), np.uint64)[first:],
        array_at(memory, header[word.ACTIVE], (first + lanes,), np.bool_)[first:],
    )
