"""Drivers of the payload: the arm's constants follow from it, and the tip takes it up and puts it down on the way.

A payload arrives with the tip's velocity and leaves with it: no impulse acts. So the arm's rates v stay, its momenta
become ``M(y) v`` with the new mass matrix, and its energy changes by the payload's own, half its mass times the tip's
squared speed. `imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy import floor

from flexarm_env.codegen.arrays import Arena, Table
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.kernels.entries import clock_row, constant, drawn, lane_setting, setting, word
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.recorded import elimination_kernel, momentum_kernel
from flexarm_env.kernels.variants import Block, variant
from flexarm_env.physics.polyline import AHEAD

NEAR = 0.02  # [m]; a tip that is not farther from the reference has arrived


def set_constants(arena: Arena, own: Table, carried: float, i: int) -> None:
    """Compute the constants of lane i's arm from its own settings, its episode and the payload at its tip [kg]."""
    payload = carried - own[lane_setting.BASE + drawn.PAYLOAD_MASS]
    stiffness = arena[row.EPISODE + drawn.STIFFNESS, i]
    # damping is linear in its ratio, and grows with the root of the stiffness (`physics.damping`)
    ratio = arena[row.EPISODE + drawn.DAMPING, i]
    damping = ratio * sqrt(stiffness) - own[lane_setting.BASE + drawn.DAMPING]
    for n in range(variant.constants):
        value = (
            own[lane_setting.ARM + n]
            + payload * own[lane_setting.PER_PAYLOAD + n]
            + damping * own[lane_setting.PER_DAMPING + n]
        )
        if constant.STIFFNESS_1 <= n < constant.DAMPING_1:
            value *= stiffness
        arena[row.CONSTANTS + n, i] = value


def carried_payload(block: Block, i: int, ahead: int) -> float:
    """Return what the tip of lane i carries in the integration step that begins some steps after now [kg].

    It is what the latest of the lap's changes left; before the first one, the last one of the lap before.
    """
    settings, arena, clock = block.settings, block.arena, block.clock
    laps = (clock[clock_row.STEPS, i] + ahead + AHEAD) * settings[setting.STEP] / arena[row.LAP, i]
    phase = laps - floor(laps)
    latest = variant.payloads - 1
    for n in range(variant.payloads):
        latest = n if settings[setting.CHANGE_PHASES + n] <= phase else latest
    mass = settings[setting.CHANGE_MASSES + latest]
    return mass if mass == mass else arena[row.EPISODE + drawn.PAYLOAD_MASS, i]


def begin_payload(block: Block, own: Table, i: int) -> None:
    """Give lane i, whose episode begins, the payload of that moment of the lap."""
    arena = block.arena
    arena[row.CARRIED, i] = carried_payload(block, i, 0)
    arena[row.MISSED, i] = 0.0
    set_constants(arena, own, arena[row.CARRIED, i], i)


def change_payloads(block: Block, done: int) -> None:
    """Change the payloads that are due once `done` steps of a period are over, and note whether the tip was there."""
    header, arena = block.header, block.arena
    shape = (header[word.LANE_SETTING_ROWS], header[word.LANE_SETTING_COLUMNS])
    owns = array_at(block.memory, header[word.LANE_SETTINGS], shape, np.float64)
    changes = 0
    for i in range(variant.lanes):
        mass = carried_payload(block, i, done)
        changed = mass != arena[row.CARRIED, i]
        arena[row.STARTS, i] = 1.0 if changed else 0.0
        changes += changed
        if changed:
            arena[row.CARRIED, i] = mass
            set_constants(arena, owns[(block.first + i) % owns.shape[0]], mass, i)
            if not variant.own_paths:  # moves have a success of their own (`observe.note_rest`)
                missed = not arena[row.TIP_ERROR, i] <= NEAR
                arena[row.MISSED, i] = 1.0 if missed else arena[row.MISSED, i]
                arena[row.SUCCESS, i] = 1.0 - arena[row.MISSED, i]
    if changes > 0:
        if not variant.foreshortened:
            elimination_kernel(arena)
        momentum_kernel(arena)
