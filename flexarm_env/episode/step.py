"""The parts of an environment's control period (`kernels.period`), and the programs of environments.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

import numpy as np

from flexarm_env.codegen.arrays import Arena, Clock, History, Mask, Memory, Paths, Table, Words
from flexarm_env.codegen.declarations import Program, inlined_in_its_caller
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.episode import reward
from flexarm_env.episode.actuation import DRIVES, drive
from flexarm_env.episode.observe import observe, take_actions
from flexarm_env.episode.reset import reset_lanes
from flexarm_env.kernels.entries import word
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.period import step_block, step_blocks
from flexarm_env.kernels.variants import variant


def step_only(memory: Memory) -> bool:
    """Advance a single environment by one control period, or begin its episode (`step_block`).

    Args:
        memory: of the batch.

    Returns:
        False if an action is not finite, unless an episode begins; the state is then unchanged.
    """
    header = array_at(memory, 0, (word.PLACES,), np.int64)
    channels = header[word.CHANNELS]
    actions = array_at(memory, header[word.ACTIONS], (channels,), np.float32)
    starting = array_at(memory, header[word.STARTS], (1,), np.bool_)[0]
    for r in range(channels if header[word.DRIVING] != 0 and not starting else 0):
        if actions[r] - actions[r] != 0.0:
            return False
    step_block(memory, 0)
    array_at(memory, header[word.STARTS], (1,), np.bool_)[0] = False
    return True


@inlined_in_its_caller
def act_on_actions(
    memory: Memory,
    arena: Arena,
    history: History,
    clock: Clock,
    paths: Paths,
    header: Words,
    settings: Table,
    first: int,
) -> None:
    """Take the actions of a block and let them act; see `period.act`."""
    lanes = first + variant.lanes
    actions = array_at(memory, header[word.ACTIONS], (lanes, header[word.CHANNELS]), np.float32)
    take_actions(arena, actions, first, header)
    drive(arena, history, clock, paths, header, settings)


@inlined_in_its_caller
def report_episodes(
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
    """Observe the lanes of a block, or those that begin an episode; see `period.report`."""
    lanes = first + variant.lanes
    keys = array_at(memory, header[word.KEYS], (lanes,), np.uint64)[first:]
    active = array_at(memory, header[word.ACTIVE], (lanes,), np.bool_)[first:]
    observations = array_at(memory, header[word.OBSERVATIONS], (lanes, header[word.OBSERVED]), np.float32)
    for i in range(variant.lanes):
        active[i] = header[word.DRIVING] != 0 or started[i]
    observe(arena, history, clock, keys, paths, header, settings, observations, first, active)
    for i in range(variant.lanes):
        if started[i]:  # a reset has no reward
            for n in range(variant.reward_terms):
                arena[row.REWARD_TERMS + n, i] = 0.0
            arena[row.REWARD, i] = 0.0


# The programs of environments, by name: one for each driver of `actuation.DRIVES`.
PROGRAMS = {
    name: Program(
        name,
        entry_points=(step_blocks,),
        alone=(step_only,),
        groups=frozenset({"environment", *one.groups}),
        parts={"act": act_on_actions, "begin": reset_lanes, "report": report_episodes, "drive": one.driver},
        reward_terms=len(reward.TERMS),
        closed=True,
        words=one.words,
    )
    for name, one in DRIVES.items()
}
TORQUE, TRACKING, GAIN = (PROGRAMS[name] for name in ("torque", "tracking", "gain"))
