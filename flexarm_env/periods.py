"""The driver that Python calls: episodes begun, and one control period of a batch.

Assembled and compiled like `stepping`, which explains lanes, blocks and arenas.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from flexarm_env.drives import drive
from flexarm_env.episodes import observe, take_actions
from flexarm_env.starts import begin_lanes, start_law

LANES = 1
CHANNELS = PREVIEWS = OBSERVED = DRIVING = ARENA_SIZE = HISTORY_SIZE = PATH_COUNT = PATH_POINTS = ORDER_COLUMNS = 0
ARENAS = HISTORIES = CLOCKS = KEYS = STARTS = LOOKING = ACTIONS = OBSERVATIONS = SETTINGS = PATHS = ORDERS = 0
PLACES = HORIZONS = CLOCK = REWARD = REWARD_TERMS = TERMS = 0
LAW = False


def array_at(memory: Any, first: int, shape: tuple[int, ...], dtype: Any) -> Any:
    """The array that begins at a word of the memory (`machine.array_at`)."""
    raise NotImplementedError("the intrinsic exists in assembled modules only")


def step_episodes(memory: Any, begin: int, end: int) -> bool:
    """One control period of some blocks, unless `DRIVING` is 0; lanes that begin an episode do so at its end.

    So a lane that begins costs its block no second look.

    Args:
        memory: of the fleet; the plan lies at its beginning, and says where the arrays of `rows.MEMORY` are.
        begin: first block.
        end: block after the last.

    Returns:
        Whether it was done: an only environment refuses an action that is not finite, unless it begins an episode.
    """
    observed = array_at(memory, OBSERVED, (1,), np.int64)[0]
    plan = array_at(memory, 0, (PLACES + observed,), np.int64)
    settings = array_at(memory, plan[SETTINGS], (HORIZONS + plan[PREVIEWS] + observed,), np.float64)
    paths = array_at(memory, plan[PATHS], (plan[PATH_COUNT], plan[PATH_POINTS], 5), np.float64)
    lanes = end * LANES
    orders = array_at(memory, plan[ORDERS], (lanes, plan[ORDER_COLUMNS]), np.float64)
    actions = array_at(memory, plan[ACTIONS], (lanes, plan[CHANNELS]), np.float64)
    observations = array_at(memory, plan[OBSERVATIONS], (lanes, observed), np.float32)
    keys = array_at(memory, plan[KEYS], (lanes,), np.uint64)
    starts = array_at(memory, plan[STARTS], (lanes,), np.bool_)
    looking = array_at(memory, plan[LOOKING], (lanes,), np.bool_)
    arena_size, history_size = plan[ARENA_SIZE], plan[HISTORY_SIZE]
    driving = plan[DRIVING] != 0
    for r in range(plan[CHANNELS] if LANES == 1 and driving and not starts[0] else 0):
        if actions[0, r] - actions[0, r] != 0.0:
            return False
    for block in range(begin, end):
        first = block * LANES
        arena = array_at(memory, plan[ARENAS] + block * arena_size, (arena_size,), np.float64)
        history = array_at(memory, plan[HISTORIES] + block * history_size, (history_size,), np.float64)
        clock = array_at(memory, plan[CLOCKS] + first * CLOCK, (CLOCK, LANES), np.int64)
        key, started, who = keys[first : first + LANES], starts[first : first + LANES], looking[first : first + LANES]
        starting = False
        for i in range(LANES):
            starting = starting or started[i]
        if not (driving or starting):
            continue
        if driving:
            take_actions(arena, actions, first, plan)
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
                    started[i] = False
    return True
