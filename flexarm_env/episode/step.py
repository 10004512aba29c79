"""The parts of an environment's control period (`kernels.period`), and the programs of environments.

`imex` explains lanes, blocks and arenas. A control period has two halves: what is decided (actions, what they command,
where an episode starts), and what is observed. In between the arm moves: our own within the first half, by `drive`;
another plant by its host, which calls the halves one by one (`step_half`).
"""

from __future__ import annotations

import numpy as np

from flexarm_env.codegen.arrays import Arena, Clock, History, Mask, Memory, Paths, Table, Words
from flexarm_env.codegen.declarations import Function, Program, inlined_in_its_caller
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.episode import reward
from flexarm_env.episode.actuation import DRIVES, HOST_DRIVES, Drive, drive
from flexarm_env.episode.first_readings import begin_sensors
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


def _program(name: str, one: Drive, alone: Function, *groups: str) -> Program:
    return Program(
        name,
        entry_points=(step_blocks,),
        alone=(alone,),
        groups=frozenset({"environment", *one.groups, *groups}),
        parts={"act": act_on_actions, "begin": reset_lanes, "report": report_episodes, "drive": one.driver},
        reward_terms=len(reward.TERMS),
        closed=True,
        words=one.words,
    )


# The programs of environments, by name; each has one of the ways in which an action moves the arm.
PROGRAMS = {name: _program(name, one, step_only) for name, one in DRIVES.items()}
# Those of environments whose plant another engine advances, by the same names (`step_half`).
HOST_PROGRAMS = {name: _program(f"hosted_{name}", one, step_half, "hosted") for name, one in HOST_DRIVES.items()}
TORQUE, TRACKING, GAIN = (PROGRAMS[name] for name in ("torque", "tracking", "gain"))
