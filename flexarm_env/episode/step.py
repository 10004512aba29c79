"""The entry points that step one environment (`period` has that of a batch), and the programs of environments.

`imex` explains lanes, blocks and arenas. A control period has two halves: what is decided (actions, what they command,
where an episode starts), and what is observed. In between the arm moves: our own within the first half, by `drive`;
another plant by its host, which calls the halves one by one (`step_half`).
"""

from __future__ import annotations

import numpy as np

from flexarm_env.codegen.arrays import Memory
from flexarm_env.codegen.declarations import Function, Program
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.episode import reward
from flexarm_env.episode.actuation import DRIVES, HOST_DRIVES, Drive
from flexarm_env.episode.period import step_block, step_blocks
from flexarm_env.kernels.entries import word


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
    clear_reset_flag(memory)
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
        clear_reset_flag(memory)
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


def clear_reset_flag(memory: Memory) -> None:
    """Note that the only environment's episode has begun."""
    header = array_at(memory, 0, (word.PLACES,), np.int64)
    array_at(memory, header[word.STARTS], (1,), np.bool_)[0] = False


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
