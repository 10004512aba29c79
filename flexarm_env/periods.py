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
DRIVING = REWARD = REWARD_TERMS = TERMS = 0
LAW = False


def step_episodes(
    arenas: Any,
    histories: Any,
    clocks: Any,
    keys: Any,
    paths: Any,
    plan: Any,
    settings: Any,
    orders: Any,
    starts: Any,
    actions: Any,
    observations: Any,
    begin: int,
    end: int,
) -> None:
    """One control period of some blocks, unless `DRIVING` is 0; lanes that begin an episode do so at its end.

    So a lane that begins costs its block no second look.

    Args:
        arenas: Shape (blocks, rows * LANES).
        histories: Shape (blocks, slots * 4 * LANES).
        clocks: Shape (blocks, CLOCK, LANES).
        keys: of the episodes, new ones where one begins. Shape (blocks, LANES).
        paths: of all lanes. Shape (paths, n, 5).
        plan: see `rows.PLAN`.
        settings: see `rows.SETTINGS`.
        orders: see `rows.ORDER`. Shape (blocks * LANES, columns).
        starts: which lanes begin an episode; cleared. Shape (blocks, LANES).
        actions: Shape (blocks * LANES, channels).
        observations: to be filled. Shape (blocks * LANES, observed).
        begin: first block.
        end: block after the last.
    """
    everyone = np.ones(LANES, dtype=np.bool_)
    driving = plan[DRIVING] != 0
    for block in range(begin, end):
        arena, history, clock = arenas[block], histories[block], clocks[block]
        started, first = starts[block], block * LANES
        starting = started.any()
        if not (driving or starting):
            continue
        if driving:
            take_actions(arena, actions, first, plan)
            drive(arena, history, clock, paths, plan, settings)
        if starting:
            begin_lanes(arena, history, clock, keys[block], paths, plan, settings, orders, first, started)
        who = everyone if driving else started
        observe(arena, history, clock, keys[block], paths, plan, settings, observations, first, who)
        if starting:
            if LAW:
                start_law(arena, history, clock, paths, settings, started)
            for i in range(LANES):
                if started[i]:  # no reward yet
                    for n in range(TERMS):
                        arena[i + (REWARD_TERMS + n) * LANES] = 0.0
                    arena[i + REWARD * LANES] = 0.0
                    started[i] = False
