"""Drivers that begin episodes: they draw them, set the lanes, and fill in what the sensors have read before.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy import floor

from flexarm_env.codegen.arrays import Arena, Clock, Four, Path, ResetRequest, Table
from flexarm_env.codegen.elementary import sincos, uniform
from flexarm_env.codegen.intrinsics import array_at
from flexarm_env.episode.further_sensors import draw_biases, further_reference
from flexarm_env.episode.payload import begin_payload, set_constants
from flexarm_env.episode.race import begin_race
from flexarm_env.episode.sensor import joint_motion, point_on_reference
from flexarm_env.kernels.delay_line import is_kept, sensed_point
from flexarm_env.kernels.entries import (
    DRAWN_COUNT,
    READING_ROWS,
    clock_row,
    column,
    constant,
    drawn,
    lane_setting,
    setting,
    word,
)
from flexarm_env.kernels.imex import prepare_law
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.recorded import elimination_kernel, momentum_kernel
from flexarm_env.kernels.reference import invalidate_segment, path_time
from flexarm_env.kernels.states import enter_state
from flexarm_env.kernels.variants import Block, variant
from flexarm_env.physics.inverse_kinematics import TURN, joint_angles_for
from flexarm_env.physics.polyline import reference_at

CORNER, CORNERS, MOVING, MIX = 0.0, 1.0, 2.0, 3.0  # how an episode starts
SHARE_AT_REST = 0.3  # of the mix
LONG_AGO = -(2**60)  # [steps]; since then the reference has been moving
# Which of an episode's random numbers its start uses.
PLACE_PATH, PLACE_MIX, PLACE_PHASE, PLACE_BRANCH, PLACE_DIRECTION = 0, 1, 2, 3, 4
PLACE_SPREAD, PLACE_DRAWN, PLACE_MOVE = 8, 16, 32


def set_quantities(arena: Arena, own: Table, request: ResetRequest, i: int) -> None:
    """Set the quantities of lane i's episode, drawn (`envs.draws`) or its own, and compute the arm's constants."""
    for n in range(DRAWN_COUNT):
        value = own[lane_setting.BASE + n]
        if request[column.DRAWN + n] == request[column.DRAWN + n]:
            value = request[column.DRAWN + n]
        arena[row.EPISODE + n, i] = value
    if not variant.payloads:
        set_constants(arena, own, arena[row.EPISODE + drawn.PAYLOAD_MASS, i], i)
    delay = arena[row.EPISODE + drawn.DELAY, i]
    for r in range(2):
        late = delay if delay == delay else own[lane_setting.SENSOR_DELAYS + r]
        arena[row.SENSOR_DELAY + r, i] = late
    arena[row.EPISODE + drawn.DELAY, i] = arena[row.SENSOR_DELAY, i]


def draw_branch(arena: Arena, key: np.uint64, own: Table, request: ResetRequest, i: int) -> None:
    """Choose the sign of theta2 of lane i's rigid arm on the reference: by the request, the settings or a draw."""
    branch = request[column.BRANCH] if request[column.BRANCH] == request[column.BRANCH] else own[lane_setting.BRANCH]
    if branch == 0.0:
        branch = 1.0 if uniform(key, PLACE_BRANCH) < 0.5 else -1.0
    arena[row.BRANCH, i] = branch


def draw_path(key: np.uint64, names: int, direction: float, request: ResetRequest) -> int:
    """Return the index of the path that an episode follows: name and direction by the request or a draw."""
    index = int(uniform(key, PLACE_PATH) * names)
    if request[column.PATH] == request[column.PATH]:
        index = int(request[column.PATH])
    if request[column.DIRECTION] == request[column.DIRECTION]:
        direction = request[column.DIRECTION]
    if direction < 0.0:
        direction = floor(2.0 * uniform(key, PLACE_DIRECTION))
    return index + int(direction) * names


def draw_start(block: Block, key: np.uint64, request: ResetRequest, i: int) -> None:
    """Choose the moment of its path at which lane i starts, at rest or on the move (`is_moving`)."""
    settings, arena, clock, paths = block.settings, block.arena, block.clock, block.paths
    path = clock[clock_row.PATH, i]
    lap = paths[path, paths.shape[1] - 1, 0]
    kind = request[column.START]
    if kind == MIX:
        kind = CORNERS if uniform(key, PLACE_MIX) < SHARE_AT_REST else MOVING
    phase = 0.0
    if kind == CORNERS:
        phase = 0.25 * lap * floor(4.0 * uniform(key, PLACE_PHASE))
    elif kind == MOVING:
        phase = settings[setting.PERIOD] * floor(uniform(key, PLACE_PHASE) * lap / settings[setting.PERIOD])
    if request[column.PHASE] == request[column.PHASE]:
        phase = request[column.PHASE]
    clock[clock_row.STEPS, i] = 0 if variant.racing else int(phase / settings[setting.STEP] + 0.5)
    clock[clock_row.BEGAN, i] = clock[clock_row.STEPS, i]
    clock[clock_row.SINCE, i] = LONG_AGO if kind == MOVING else clock[clock_row.STEPS, i]
    arena[row.START_TIME, i] = phase if variant.racing else clock[clock_row.BEGAN, i] * settings[setting.STEP]
    if variant.racing:
        begin_race(block, i)


def is_moving(clock: Clock, i: int) -> bool:
    """Return whether the arm of lane i starts on the move."""
    return clock[clock_row.SINCE, i] == LONG_AGO


def drawn_point(key: np.uint64, settings: Table, branch: float, place: int) -> tuple[float, float]:
    """Draw joint angles that put the tip at a point of the ring `Setting.MOVES`, by random numbers from `place` on."""
    low, high = settings[setting.MOVES], settings[setting.MOVES + 1]
    radius = sqrt(low * low + (high * high - low * low) * uniform(key, place))  # evenly by area
    turn = sincos(TURN * uniform(key, place + 1))
    x, y = radius * turn[1], radius * turn[0]
    return joint_angles_for(settings[setting.LENGTHS], settings[setting.LENGTHS + 1], branch, x, y)


def draw_moves(path: Path, key: np.uint64, settings: Table, branch: float, lap: float) -> None:
    """Draw an episode's path: from one point to another and back, each move from rest to rest with a rest after it.

    Both joint angles follow one polynomial of fifth degree (minimum jerk). The end points lie in the ring
    `Setting.MOVES`; theta1 turns the shorter way.

    Args:
        path: output; evenly timed, see `polyline.reference_at`. Shape (n, 5).
        key: key of the episode.
        settings: see `entries.Setting`.
        branch: sign of theta2.
        lap: time there and back [s].
    """
    start = drawn_point(key, settings, branch, PLACE_MOVE)
    end = drawn_point(key, settings, branch, PLACE_MOVE + 2)
    way_1 = end[0] - start[0]
    way_1 -= TURN * floor(way_1 / TURN + 0.5)
    way_2 = end[1] - start[1]
    last = path.shape[0] - 1
    for n in range(last + 1):
        quarters = 4.0 * n / last  # a move, a rest, a move back, a rest
        u = min(max(quarters if quarters < 2.0 else 3.0 - quarters, 0.0), 1.0)
        share = u * u * u * (10.0 + u * (6.0 * u - 15.0))
        one = sincos(start[0] + share * way_1)
        both = sincos(start[0] + share * way_1 + start[1] + share * way_2)
        path[n, 0] = lap * (n / last)
        path[n, 1] = settings[setting.LENGTHS] * one[1] + settings[setting.LENGTHS + 1] * both[1]
        path[n, 2] = settings[setting.LENGTHS] * one[0] + settings[setting.LENGTHS + 1] * both[0]
    for n in range(last):
        per_second = 1.0 / (path[n + 1, 0] - path[n, 0])
        path[n, 3] = (path[n + 1, 1] - path[n, 1]) * per_second
        path[n, 4] = (path[n + 1, 2] - path[n, 2]) * per_second


def initial_state(block: Block, key: np.uint64, request: ResetRequest, i: int) -> None:
    """Set the state of lane i: the requested one, or the rigid arm on the reference, with deviations if it moves."""
    settings, arena, clock, paths = block.settings, block.arena, block.clock, block.paths
    moving = is_moving(clock, i)
    now = path_time(arena, clock, settings[setting.STEP], 0.0, i)
    reference = reference_at(paths, clock[clock_row.PATH, i], now, now + 1e-9 * settings[setting.STEP], -1e18)
    theta1, theta2, rate_1, rate_2 = joint_motion(settings, arena[row.BRANCH, i], reference)
    if moving:
        theta1 += settings[setting.START_SPREAD] * (2.0 * uniform(key, PLACE_SPREAD) - 1.0)
        theta2 += settings[setting.START_SPREAD] * (2.0 * uniform(key, PLACE_SPREAD + 1) - 1.0)
    else:
        rate_1, rate_2 = 0.0, 0.0
    given = request[column.STATE] == request[column.STATE]
    for r in range(2 * variant.size):
        entry = r % variant.size
        value = request[column.STATE + r] if given else 0.0
        if not given and entry < 2:
            value = (theta1, theta2, rate_1, rate_2)[2 * (r // variant.size) + entry]
        first = entry == 2 or entry == 2 + variant.modes  # mode of a link
        if not given and moving and r < variant.size and first:
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
        if variant.further_readings:  # before the first action the motors are off
            arena[row.TAU + r, i] = 0.0
            arena[row.END_TORQUE + r, i] = 0.0
        if variant.law:
            arena[row.NOISE + r, i] = 0.0
        if variant.pulses:
            arena[row.TIP_FORCE + r, i] = 0.0
        if variant.motors:
            arena[row.MOTOR + r, i] = 0.0
        if variant.tracking:
            arena[row.SHIFT + r, i] = 0.0
    if variant.law:
        prepare_law(arena, i)


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
            set_quantities(arena, own, request, i)
            draw_branch(arena, keys[i], own, request, i)
            if variant.own_paths:
                clock[clock_row.PATH, i] = lane
                draw_moves(block.paths[lane], keys[i], block.settings, arena[row.BRANCH, i], arena[row.LAP, i])
            else:
                direction = own[lane_setting.DIRECTION]
                clock[clock_row.PATH, i] = draw_path(keys[i], header[word.PATH_NAMES], direction, request)
            draw_start(block, keys[i], request, i)
            if variant.payloads:
                begin_payload(block, own, i)
            initial_state(block, keys[i], request, i)
            clear_lane(block, i)
    if not (variant.foreshortened or variant.hosted):
        elimination_kernel(arena)
    if not (variant.law or variant.hosted):
        for i in range(variant.lanes):
            arena[row.STARTS, i] = 1.0 if started[i] else 0.0
        momentum_kernel(arena)


def move_history(block: Block, i: int) -> None:
    """Fill the delay line of lane i, whose arm starts on the move.

    A past position differs from the newest one as those of the rigid arm on the reference do. Before the start, sensors
    of other quantities read what they read at the start (`delay_line.fill_history`).
    """
    header, settings, history, clock = block.header, block.settings, block.history, block.clock
    h = settings[setting.STEP]
    slots = history.shape[0] // variant.slot_rows
    newest = clock[clock_row.HEAD, 0]
    for s in range(1 + variant.further_points):
        now = point_on_time(block, i, s, 0.0)
        for back in range(1, slots):
            if is_kept(header, -back):
                slot = (newest - back) % slots
                then = point_on_time(block, i, s, back * h)
                for r in range(READING_ROWS):
                    moved, at = then[r] - now[r], READING_ROWS * s + r
                    history[variant.slot_rows * slot + at, i] = history[variant.slot_rows * newest + at, i] + moved


def begin_sensors(block: Block) -> None:
    """Complete what the sensors of the lanes that begin an episode have read before, see `sensor.sense`."""
    arena, clock, started, keys = block.arena, block.clock, block.started, block.keys
    for i in range(variant.lanes):
        if started[i]:
            if is_moving(clock, i):
                move_history(block, i)
            if variant.further_readings:
                draw_biases(arena, keys, i)
            seed_sensor(block, i)


def point_on_time(block: Block, i: int, s: int, back: float) -> Four:
    """Return what a sensor would have read `back` seconds ago on the rigid arm on lane i's reference, with rates.

    Args:
        block: the block.
        i: the lane.
        s: 0 for the sensor on link 2; others: the further sensors of positions.
        back: how long ago [s].
    """
    if variant.further_points and s > 0:
        return further_reference(block, i, s - 1, block.arena[row.FURTHER_DISTANCE + s - 1, i], back)
    return reference_reading(block, i, back)


def reference_reading(block: Block, i: int, back: float) -> Four:
    """Return what the sensor would have read `back` seconds ago on the rigid arm on lane i's reference, with rates."""
    settings, arena, clock, paths = block.settings, block.arena, block.clock, block.paths
    time = clock[clock_row.STEPS, i] * settings[setting.STEP] - back
    reference = reference_at(paths, clock[clock_row.PATH, i], time, time + 1e-9 * settings[setting.STEP], -1e18)
    if variant.true_sensor:
        return point_on_reference(settings, arena[row.BRANCH, i], 2, arena[row.SENSOR_POINT_DISTANCE, i], reference)
    theta1, theta2, rate_1, rate_2 = joint_motion(settings, arena[row.BRANCH, i], reference)
    near = arena[row.REFERENCE_JOINTS, i]
    return theta1 + TURN * floor((near - theta1) / TURN + 0.5), theta2, rate_1, rate_2


def seed_sensor(block: Block, i: int) -> None:
    """Set a reading from before the start of lane i, so that the change per second of the first one is defined."""
    settings, arena, clock, paths = block.settings, block.arena, block.clock, block.paths
    h = settings[setting.STEP]
    late = arena[row.SENSOR_DELAY, i]
    later = arena[row.SENSOR_DELAY + 1, i] - late
    late += max(settings[setting.PERIOD], arena[row.HOLD, i])
    nominal = arena[row.NOMINAL_DELAY, i] + max(settings[setting.PERIOD], arena[row.NOMINAL_HOLD, i])
    taken = clock[clock_row.STEPS, i] * h - nominal
    point = sensed_point(block, i, late, late + later)
    place = arena[row.START_TIME, i] if variant.racing else taken
    since = -1e18 if variant.racing else clock[clock_row.SINCE, i] * h
    reference = reference_at(paths, clock[clock_row.PATH, i], place, place + 1e-9 * h, since)
    for r in range(2):
        arena[row.LINK_SENSOR + r, i] = point[r]
        arena[row.SENSOR_ERROR + r, i] = reference[r] - point[r]
        arena[row.SENSOR_ERROR_RATE + r, i] = 0.0
    arena[row.NOMINAL_TIME, i] = taken
    arena[row.SAMPLE_TIME, i] = clock[clock_row.STEPS, i] * h - late
