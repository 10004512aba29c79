"""Drivers that begin episodes: `draws` chooses them, this module sets the lanes, `first_readings` the delay line.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

import numpy as np

from flexarm_env.codegen.arrays import (
    Arena,
    Clock,
    History,
    Keys,
    LaneSettings,
    Mask,
    Paths,
    ResetRequest,
    ResetRequests,
    Table,
    Words,
)
from flexarm_env.codegen.declarations import inlined_in_its_caller
from flexarm_env.codegen.random_stream import uniform
from flexarm_env.episode.draws import LONG_AGO, PLACE_SPREAD, draw_branch, draw_quantities, draw_start
from flexarm_env.episode.first_readings import fill_history, seed_sensor
from flexarm_env.kernels.delay_line import prepare_readings, store_reading
from flexarm_env.kernels.entries import clock_row, column, constant, lane_setting, setting, word
from flexarm_env.kernels.imex import prepare_commands
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.path_cache import invalidate_segment
from flexarm_env.kernels.recorded import elimination_kernel, law_kernel
from flexarm_env.kernels.tableau import STAGES
from flexarm_env.kernels.variants import variant
from flexarm_env.physics.inverse_kinematics import joint_angles_for, joint_rates_for
from flexarm_env.physics.polyline import reference_at


def initial_state(
    arena: Arena,
    clock: Clock,
    key: np.uint64,
    paths: Paths,
    settings: Table,
    request: ResetRequest,
    i: int,
    moving: bool,
) -> None:
    """Set the state of lane i: the requested one, or the rigid arm on the reference, with deviations if it moves."""
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
        part = row.V if r >= variant.size else row.Y
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
        # from the public order (theta1, theta2, q1, q2) to the internal one (a1, q1, a2, q2)
        at = 0 if entry == 0 else variant.size // 2 if entry == 1 else entry - 1 if entry < 2 + variant.modes else entry
        arena[part + at, i] = value
    for part in (row.Y, row.V):
        slope = 0.0
        for n in range(variant.modes):
            slope += arena[row.CONSTANTS + constant.ELBOW_SLOPES + n, i] * arena[part + 1 + n, i]
        turn = arena[part, i] + slope + arena[part + variant.size // 2, i]
        arena[part + variant.size // 2, i] = turn
    arena[row.REFERENCE_JOINTS, i] = arena[row.Y, i]  # the reference's theta1 is within half a turn of it


def prepare_law(arena: Arena, own: Table, i: int) -> None:
    """Set the delays, weights and noise of the tip law in lane i."""
    for r in range(2):
        late = arena[row.SENSOR_DELAY + r, i] if variant.law_on_sensor else 0.0
        shared = arena[row.SENSOR_DELAY, i]
        compensation = own[lane_setting.COMPENSATION]
        command = 0.0 if compensation == 0.0 else shared if compensation == 1.0 else late
        arena[row.DELAY + r, i] = late
        arena[row.COMMAND_DELAY + r, i] = command
        arena[row.WEIGHT + r, i] = 1.0
        arena[row.RATE_WEIGHT + r, i] = 1.0
        arena[row.NOISE + r, i] = 0.0
    arena[row.GAIN, i] = 0.0
    invalidate_segment(arena, row.COMMAND_SEGMENT, i)


def start_law(arena: Arena, history: History, clock: Clock, paths: Paths, settings: Table, started: Mask) -> None:
    """Initialise the started lanes for the implicit integrator; the other lanes do not change."""
    for at in range(STAGES * variant.size):  # an earlier episode may have left numbers that are not finite
        for i in range(variant.lanes):
            if started[i]:
                arena[row.V_SLOTS + at, i] = 0.0
                arena[row.MECHANICAL_SLOTS + at, i] = 0.0
                arena[row.FEEDBACK_SLOTS + at, i] = 0.0
    # as `evaluate_law`, but the other lanes keep the torques of the start of their period
    prepare_commands(arena, clock, paths, settings[setting.STEP])
    prepare_readings(arena, history, clock, settings[setting.STEP], 0.0)
    law_kernel(arena, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    for r in range(variant.size):
        for i in range(variant.lanes):
            if started[i]:
                arena[row.V_SLOTS + r, i] = arena[row.V_STAGE + r, i]
                arena[row.MECHANICAL_SLOTS + r, i] = arena[row.MECHANICAL + r, i]
                arena[row.FEEDBACK_SLOTS + r, i] = arena[row.FEEDBACK + r, i]


def reset_lane(
    arena: Arena,
    clock: Clock,
    key: np.uint64,
    paths: Paths,
    header: Words,
    settings: Table,
    own: Table,
    request: ResetRequest,
    lane: int,
    i: int,
) -> None:
    """Begin an episode in lane i, except for its delay line."""
    draw_quantities(arena, key, own, request, i)
    draw_branch(arena, key, own, request, i)
    moving = draw_start(arena, clock, key, paths, header, settings, own, request, lane, i)
    initial_state(arena, clock, key, paths, settings, request, i, moving)
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
    if variant.tracking:
        arena[row.SHIFT, i] = 0.0
        arena[row.SHIFT + 1, i] = 0.0


@inlined_in_its_caller
def reset_lanes(
    arena: Arena,
    clock: Clock,
    keys: Keys,
    paths: Paths,
    header: Words,
    settings: Table,
    owns: LaneSettings,
    reset_requests: ResetRequests,
    first: int,
    started: Mask,
) -> None:
    """Begin episodes in some lanes of a block, before the first measurement; the other lanes do not change.

    Args:
        arena: of the block.
        clock: of each lane.
        keys: keys of the lanes' episodes. Shape (lanes,).
        paths: of all lanes. Shape (paths, n, 5).
        header: see `entries.Header`.
        settings: see `entries.Setting`.
        owns: see `entries.LaneSetting`. Shape (blocks * lanes or 1, columns).
        reset_requests: see `entries.Column`. Shape (blocks * lanes, columns).
        first: index of the block's first lane among all lanes.
        started: which lanes begin an episode. Shape (lanes,).
    """
    for i in range(variant.lanes):
        if started[i]:
            lane = first + i
            own = owns[lane % owns.shape[0]]
            reset_lane(arena, clock, keys[i], paths, header, settings, own, reset_requests[lane], lane, i)
            if variant.law:
                prepare_law(arena, own, i)
    if not (variant.foreshortened or variant.hosted):
        elimination_kernel(arena)


@inlined_in_its_caller
def begin_sensors(
    arena: Arena, history: History, clock: Clock, paths: Paths, header: Words, settings: Table, started: Mask
) -> None:
    """Fill the delay lines of the lanes that begin an episode, before the first measurement.

    Args: as `reset_lanes`, and
        history: readings at past steps; those of another engine's plant have their newest one already.
    """
    if not variant.hosted:
        # for lanes that go on, the reading is already there, or no sensor reads this slot
        store_reading(arena, history, clock[clock_row.HEAD, 0])
    for i in range(variant.lanes):
        if started[i]:
            moving = clock[clock_row.SINCE, i] == LONG_AGO
            fill_history(arena, history, clock, paths, header, settings, i, moving)
            seed_sensor(arena, history, clock, paths, settings, i)
