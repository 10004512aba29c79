"""The drivers that Python calls: episodes begun, and one control period of one environment or of a batch.

Assembled and compiled like `stepping`, which explains lanes, blocks and arenas.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexarm_env.episode.actuation import drive
from flexarm_env.episode.observe import observe, take_actions
from flexarm_env.episode.reset import begin_lanes, start_law

LANES = 1
CHANNELS = PREVIEWS = OBSERVED = DRIVING = ARENA_SIZE = HISTORY_SIZE = PATH_COUNT = PATH_POINTS = ORDER_COLUMNS = 0
ARENAS = HISTORIES = CLOCKS = KEYS = STARTS = LOOKING = ACTIONS = OBSERVATIONS = SETTINGS = PATHS = ORDERS = 0
RESULTS = BEGINNINGS = PLACES = HORIZONS = CLOCK = REWARD = REWARD_TERMS = TERMS = 0
LAW = False


def array_at(memory: Any, first: int, shape: tuple[int, ...], dtype: Any) -> Any:
    """The array that begins at a word of the memory (`machine.array_at`)."""
    raise NotImplementedError("the intrinsic exists in assembled modules only")


def step_only(memory: Any) -> bool:
    """One control period of the only environment, or the beginning of its episode (`step_block`).

    Args:
        memory: of the fleet.

    Returns:
        Whether it was done: an action that is not finite is refused, unless an episode begins.
    """
    plan = array_at(memory, 0, (PLACES,), np.int64)
    channels = plan[CHANNELS]
    actions = array_at(memory, plan[ACTIONS], (channels,), np.float32)
    starting = array_at(memory, plan[STARTS], (1,), np.bool_)[0]
    for r in range(channels if plan[DRIVING] != 0 and not starting else 0):
        if actions[r] - actions[r] != 0.0:
            return False
    step_block(memory, 0)
    array_at(memory, plan[STARTS], (1,), np.bool_)[0] = False
    return True


def step_blocks(memory: Any, begin: int, end: int, results: Any) -> None:
    """One control period of some blocks (`step_block`), and what is known at its end.

    How an episode began is told where one did; elsewhere it is 0.

    Args:
        memory: of the fleet.
        begin: first block.
        end: block after the last.
        results: to be filled; the parts of `rows.episode_sizes`. Shape (parts, lanes).
    """
    plan = array_at(memory, 0, (PLACES,), np.int64)
    for block in range(begin, end):
        step_block(memory, block)
        arena = array_at(memory, plan[ARENAS] + block * plan[ARENA_SIZE], (plan[ARENA_SIZE],), np.float64)
        started = array_at(memory, plan[STARTS], ((block + 1) * LANES,), np.bool_)[block * LANES :]
        for row in range(results.shape[0]):
            known = arena[(RESULTS + row) * LANES : (RESULTS + row + 1) * LANES]
            told = results[row, block * LANES : (block + 1) * LANES]
            for i in range(LANES if row < BEGINNINGS else 0):
                told[i] = known[i] if started[i] else 0.0
            for i in range(LANES if row >= BEGINNINGS else 0):
                told[i] = known[i]
        for i in range(LANES):
            started[i] = False


def step_block(memory: Any, block: int) -> None:
    """One control period of a block, unless `DRIVING` is 0; lanes that begin an episode do so at its end.

    So a lane that begins costs its block no second look. The caller forgets then which lanes began.

    Args:
        memory: of the fleet; the plan lies at its beginning, and says where the arrays of `rows.MEMORY` are.
        block: which.
    """
    observed = array_at(memory, OBSERVED, (1,), np.int64)[0]
    plan = array_at(memory, 0, (PLACES + observed,), np.int64)
    settings = array_at(memory, plan[SETTINGS], (HORIZONS + plan[PREVIEWS] + observed,), np.float64)
    paths = array_at(memory, plan[PATHS], (plan[PATH_COUNT], plan[PATH_POINTS], 5), np.float64)
    arena_size, history_size = plan[ARENA_SIZE], plan[HISTORY_SIZE]
    arena = array_at(memory, plan[ARENAS] + block * arena_size, (arena_size,), np.float64)
    history = array_at(memory, plan[HISTORIES] + block * history_size, (history_size,), np.float64)
    first = block * LANES
    clock = array_at(memory, plan[CLOCKS] + first * CLOCK, (CLOCK, LANES), np.int64)
    lanes = first + LANES  # the arrays of all lanes, up to these
    key = array_at(memory, plan[KEYS], (lanes,), np.uint64)[first:]
    started = array_at(memory, plan[STARTS], (lanes,), np.bool_)[first:]
    who = array_at(memory, plan[LOOKING], (lanes,), np.bool_)[first:]
    orders = array_at(memory, plan[ORDERS], (lanes, plan[ORDER_COLUMNS]), np.float64)
    observations = array_at(memory, plan[OBSERVATIONS], (lanes, observed), np.float32)
    driving, starting = plan[DRIVING] != 0, False
    for i in range(LANES):
        starting = starting or started[i]
    if not (driving or starting):
        return
    if driving:
        take_actions(arena, array_at(memory, plan[ACTIONS], (lanes, plan[CHANNELS]), np.float32), first, plan)
        drive(arena, history, clock, paths, plan, settings)
    if starting:
        begin_lanes(arena, history, clock, key, paths, plan, settings, orders, first, started)
    for i in range(LANES):
        who[i] = driving or started[i]
    observe(arena, history, clock, key, paths, plan, settings, observations, first, who)
    if starting:
        if LAW:
            start_law(arena, history, clock, paths, settings, started)
        for i in range(LANES):
            if started[i]:  # no reward yet
                for n in range(TERMS):
                    arena[i + (REWARD_TERMS + n) * LANES] = 0.0
                arena[i + REWARD * LANES] = 0.0
