"""Drivers that begin episodes: `initial_conditions` draws them, this module sets the lanes, `first_readings` the past.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

import numpy as np

from flexarm_env.codegen.arrays import ResetRequest
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.codegen.random_stream import uniform
from flexarm_env.episode.initial_conditions import (
    PLACE_SPREAD,
    draw_branch,
    draw_moves,
    draw_path,
    draw_quantities,
    draw_start,
    is_moving,
)
from flexarm_env.kernels.block import Block
from flexarm_env.kernels.entries import clock_row, column, constant, setting, word
from flexarm_env.kernels.law import prepare_law
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.path_cache import invalidate_segment
from flexarm_env.kernels.recorded import elimination_kernel, momentum_kernel
from flexarm_env.kernels.states import enter_state
from flexarm_env.kernels.variants import variant
from flexarm_env.physics.inverse_kinematics import joint_angles_for, joint_rates_for
from flexarm_env.physics.polyline import reference_at


def initial_state(block: Block, key: np.uint64, request: ResetRequest, i: int) -> None:
    """Set the state of lane i: the requested one, or the rigid arm on the reference, with deviations if it moves."""
    settings, arena, clock, paths = block.settings, block.arena, block.clock, block.paths
    moving = is_moving(clock, i)
    now = clock[clock_row.STEPS, i] * settings[setting.STEP]
    reference = reference_at(paths, clock[clock_row.PATH, i], now, now + 1e-9 * settings[setting.STEP], -1e18)
    length_1, length_2 = settings[setting.LENGTHS], settings[setting.LENGTHS + 1]
    theta1, theta2 = joint_angles_for(length_1, length_2, arena[row.BRANCH, i], reference[0], reference[1])
    rate_1, rate_2 = 0.0, 0.0
    if moving:
        rate_1, rate_2 = joint_rates_for(length_1, length_2, theta1, theta2, reference[2], reference[3])
        theta1 += settings[setting.START_SPREAD] * (2.0 * uniform(key, PLACE_SPREAD) - 1.0)
        theta2 += settings[setting.START_SPREAD] * (2.0 * uniform(key, PLACE_SPREAD + 1) - 1.0)
    given = request[column.STATE] == request[column.STATE]
    for r in range(2 * variant.size):
        entry = r % variant.size
        value = request[column.STATE + r] if given else 0.0
        if not given and entry < 2:
            value = (theta1, theta2, rate_1, rate_2)[2 * (r // variant.size) + entry]
        if (
            not given and moving and r < variant.size and (entry == 2 or entry == 2 + variant.modes)
        ):  # the links' first modes
            link = 0 if entry == 2 else 1
            tip = arena[row.CONSTANTS + constant.ELBOW_VALUES if link == 0 else row.TIP_VALUES, i]
            value = settings[setting.START_SPREAD + 1] / tip * (2.0 * uniform(key, PLACE_SPREAD + 2 + link) - 1.0)
        arena[row.STATE + r, i] = value
    enter_state(arena, i)
    arena[row.REFERENCE_JOINTS, i] = arena[row.Y, i]  # the joint aim stays within half a turn of it


def clear_lane(block: Block, i: int) -> None:
    """Set all that an earlier episode left in lane i to its initial value, except for the delay line."""
    header, settings, arena, clock = block.header, block.settings, block.arena, block.clock
    newest = row.TAIL + 2 * header[word.PREVIEWS]
    for at in range(header[word.KEPT_ACTIONS] * header[word.CHANNELS]):
        arena[row.TAIL + header[word.COMMANDS] + at, i] = 0.0
        arena[newest + at, i] = settings[setting.IDLE_ACTION]
    invalidate_segment(arena, row.PRESENT_SEGMENT, i)
    arena[row.ACTION_CHANGE, i] = 0.0
    arena[row.EFFECTIVE_GAIN, i] = 0.0
    arena[row.ELBOW_SIDE, i] = 0.0
    arena[row.MEASURED_SIDE, i] = 0.0
    arena[row.ELBOW_CHANGES, i] = 0.0
    arena[row.SUCCESS, i] = 0.0
    arena[row.AWAY, i] = (clock[clock_row.STEPS, i] - 1) * settings[setting.STEP]
    for r in range(2):
        arena[row.TORQUE + r, i] = 0.0
        arena[row.SENSOR_ERROR + r, i] = 0.0
    if variant.further_readings:
        for r in range(2):  # before the first action the motors are off
            arena[row.TAU + r, i] = 0.0
            arena[row.END_TORQUE + r, i] = 0.0
    if variant.law:
        arena[row.NOISE, i] = 0.0
        arena[row.NOISE + 1, i] = 0.0
        prepare_law(arena, i)
    if variant.tracking:
        arena[row.SHIFT, i] = 0.0
        arena[row.SHIFT + 1, i] = 0.0


def reset_lanes(block: Block) -> None:
    """Begin episodes in some lanes of a block, with new keys."""
    memory, first, header, arena, clock = block.memory, block.first, block.header, block.arena, block.clock
    keys, started, lanes = block.keys, block.started, first + variant.lanes
    reset_requests = array_at(memory, header[word.RESET_REQUESTS], (lanes, header[word.REQUEST_COLUMNS]), np.float64)
    columns = header[word.LANE_SETTING_COLUMNS]
    owns = array_at(memory, header[word.LANE_SETTINGS], (header[word.LANE_SETTING_ROWS], columns), np.float64)
    for i in range(variant.lanes):
        if started[i]:
            lane = first + i
            own = owns[lane % owns.shape[0]]
            request = reset_requests[lane]
            draw_quantities(arena, keys[i], own, request, i)
            draw_branch(arena, keys[i], own, request, i)
            if variant.own_paths:
                clock[clock_row.PATH, i] = lane
                draw_moves(block.paths[lane], keys[i], block.settings, arena[row.BRANCH, i])
            else:
                clock[clock_row.PATH, i] = draw_path(keys[i], header, own, request)
            draw_start(block, keys[i], request, i)
            initial_state(block, keys[i], request, i)
            clear_lane(block, i)
    if not (variant.foreshortened or variant.hosted):
        elimination_kernel(arena)
    if not (variant.law or variant.hosted):
        for i in range(variant.lanes):
            arena[row.STARTS, i] = 1.0 if started[i] else 0.0
        momentum_kernel(arena)
