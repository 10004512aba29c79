"""Drivers that begin episodes: what is drawn for them, where the arm starts, and what its delay line holds.

`stepping` explains lanes, blocks and arenas.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy import floor

from flexarm_env.codegen.arrays import (
    Arena,
    Clock,
    Four,
    History,
    Keys,
    Mask,
    Path,
    Paths,
    ResetRequest,
    ResetRequests,
    Table,
    Words,
)
from flexarm_env.codegen.declarations import inlined_in_its_caller
from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.random_stream import uniform
from flexarm_env.episode.sensor import sensed_point
from flexarm_env.kernels.entries import QUANTITIES, clock_row, column, constant, drawn, setting, word
from flexarm_env.kernels.imex import prepare_commands, prepare_readings, store_reading
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.path_cache import invalidate_segment
from flexarm_env.kernels.recorded import elimination_kernel, law_kernel
from flexarm_env.kernels.tableau import STAGES
from flexarm_env.kernels.variants import variant
from flexarm_env.physics.inverse_kinematics import joint_angles_for, joint_rates_for
from flexarm_env.physics.polyline import reference_at

CORNER, CORNERS, MOVING, MIX = 0.0, 1.0, 2.0, 3.0  # how an episode starts
SHARE_AT_REST = 0.3  # of the mix
LONG_AGO = -(2**60)  # [steps]; since then the reference has been moving
# Which of an episode's random numbers its start uses.
PLACE_PATH, PLACE_MIX, PLACE_PHASE = 0, 1, 2
PLACE_SPREAD, PLACE_DRAWN, PLACE_MOVE = 8, 16, 32


def draw_quantities(arena: Arena, key: np.uint64, settings: Table, request: ResetRequest, i: int) -> None:
    """What is drawn for lane i's episode, unless the order names it, and the arm that follows from it."""
    for n in range(QUANTITIES):
        value = settings[setting.BASE + n]
        low = settings[setting.LOWEST + n]
        if low == low:
            value = low + (settings[setting.HIGHEST + n] - low) * uniform(key, PLACE_DRAWN + n)
        if request[column.DRAWN + n] == request[column.DRAWN + n]:
            value = request[column.DRAWN + n]
        arena[row.EPISODE + n, i] = value
    payload = arena[row.EPISODE + drawn.PAYLOAD_MASS, i] - settings[setting.BASE + drawn.PAYLOAD_MASS]
    stiffness = arena[row.EPISODE + drawn.STIFFNESS, i]
    # modal damping is 2 zeta omega m, and omega grows with the root of the stiffness
    ratio = arena[row.EPISODE + drawn.DAMPING, i]
    damping = ratio * sqrt(stiffness) - settings[setting.BASE + drawn.DAMPING]
    for n in range(variant.constants):
        value = (
            settings[setting.ARM + n]
            + payload * settings[setting.PER_PAYLOAD + n]
            + damping * settings[setting.PER_DAMPING + n]
        )
        if constant.STIFFNESS_1 <= n < constant.DAMPING_1:
            value *= stiffness
        arena[row.CONSTANTS + n, i] = value
    delay = arena[row.EPISODE + drawn.DELAY, i]
    for r in range(2):
        late = delay if delay == delay else settings[setting.SENSOR_DELAYS + r]
        arena[row.SENSOR_DELAY + r, i] = late
    arena[row.EPISODE + drawn.DELAY, i] = arena[row.SENSOR_DELAY, i]


@inlined_in_its_caller
def draw_start(
    arena: Arena, clock: Clock, key: np.uint64, paths: Paths, settings: Table, request: ResetRequest, lane: int, i: int
) -> bool:
    """Path and moment at which lane i starts; whether the arm starts on the move."""
    index = int(uniform(key, PLACE_PATH) * paths.shape[0])
    if variant.own_paths:  # a constant: where it is false, the compiler never sees what follows
        index = lane
        draw_moves(paths[lane], key, settings)
    elif request[column.PATH] == request[column.PATH]:
        index = int(request[column.PATH])
    lap = paths[index, paths.shape[1] - 1, 0]
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
    clock[clock_row.PATH, i] = index
    clock[clock_row.STEPS, i] = int(phase / settings[setting.STEP] + 0.5)
    clock[clock_row.BEGAN, i] = clock[clock_row.STEPS, i]
    arena[row.START_TIME, i] = clock[clock_row.BEGAN, i] * settings[setting.STEP]
    moving = kind == MOVING
    clock[clock_row.SINCE, i] = LONG_AGO if moving else clock[clock_row.STEPS, i]
    return moving


def drawn_point(key: np.uint64, settings: Table, place: int) -> tuple[float, float]:
    """Joint angles that put the tip at a point of the ring `Setting.MOVES`, by two random numbers from a place on."""
    low, high = settings[setting.MOVES], settings[setting.MOVES + 1]
    radius = sqrt(low * low + (high * high - low * low) * uniform(key, place))  # evenly by area
    turn = sincos(6.283185307179586 * uniform(key, place + 1))
    x, y = radius * turn[1], radius * turn[0]
    return joint_angles_for(settings[setting.LENGTHS], settings[setting.LENGTHS + 1], settings[setting.BRANCH], x, y)


def draw_moves(path: Path, key: np.uint64, settings: Table) -> None:
    """A path of an episode's own: from one point to another and back, each move from rest to rest, then a rest.

    The joint angles run together along a polynomial of fifth degree (minimum jerk); points are drawn in the ring that
    `Setting.MOVES` sets, theta1's way is the shorter one.

    Args:
        path: to be filled; evenly timed, see `sides.reference_at`. Shape (n, 5).
        key: of the episode.
        settings: see `entries.Setting`.
    """
    start = drawn_point(key, settings, PLACE_MOVE)
    end = drawn_point(key, settings, PLACE_MOVE + 2)
    way_1 = end[0] - start[0]
    way_1 -= 6.283185307179586 * floor(way_1 / 6.283185307179586 + 0.5)
    way_2 = end[1] - start[1]
    last = path.shape[0] - 1
    lap = settings[setting.LAP]
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
    """State of lane i: as ordered, or the rigid arm on the reference, on the move a little off it."""
    now = clock[clock_row.STEPS, i] * settings[setting.STEP]
    reference = reference_at(paths, clock[clock_row.PATH, i], now, now + 1e-9 * settings[setting.STEP], -1e18)
    length_1, length_2 = settings[setting.LENGTHS], settings[setting.LENGTHS + 1]
    theta1, theta2 = joint_angles_for(length_1, length_2, settings[setting.BRANCH], reference[0], reference[1])
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
    arena[row.REFERENCE_JOINTS, i] = arena[row.Y, i]  # the joint aim stays within half a turn of it


def fill_history(
    arena: Arena, history: History, clock: Clock, paths: Paths, header: Words, settings: Table, i: int, moving: bool
) -> None:
    """The delay line of lane i: its newest reading, moved back with the reference if the arm starts on the move."""
    h = settings[setting.STEP]
    slots = history.shape[0] // 4
    newest = clock[clock_row.HEAD, 0]
    now = reference_reading(arena, clock, paths, settings, i, 0.0)
    for back in range(slots):
        if not (header[word.READINGS] >> (-back % header[word.SUBSTEPS] & 63)) & 1:
            continue  # nobody will ask for it
        slot = (newest - back) % slots
        moved = reference_reading(arena, clock, paths, settings, i, back * h) if moving and back > 0 else now
        for r in range(4):
            value = history[4 * newest + r, i]
            if moving:
                value += moved[r] - now[r]
            elif r >= 2 and back > 0:
                value = 0.0  # before the start nothing moved
            history[4 * slot + r, i] = value


def reference_reading(arena: Arena, clock: Clock, paths: Paths, settings: Table, i: int, back: float) -> Four:
    """What the sensor would read on the rigid arm that is on lane i's reference, some seconds ago; with rates."""
    time = clock[clock_row.STEPS, i] * settings[setting.STEP] - back
    x, y, vx, vy = reference_at(paths, clock[clock_row.PATH, i], time, time + 1e-9 * settings[setting.STEP], -1e18)
    length_1, length_2 = settings[setting.LENGTHS], settings[setting.LENGTHS + 1]
    if (
        variant.true_sensor and arena[row.SENSOR_POINT_DISTANCE, i] == length_2
    ):  # it is the tip that is on the reference
        return x, y, vx, vy
    theta1, theta2 = joint_angles_for(length_1, length_2, settings[setting.BRANCH], x, y)
    rate_1, rate_2 = joint_rates_for(length_1, length_2, theta1, theta2, vx, vy)
    if not variant.true_sensor:
        near = arena[row.REFERENCE_JOINTS, i]
        return theta1 + 6.283185307179586 * floor((near - theta1) / 6.283185307179586 + 0.5), theta2, rate_1, rate_2
    distance = arena[row.SENSOR_POINT_DISTANCE, i]
    one, both = sincos(theta1), sincos(theta1 + theta2)
    rate_12 = rate_1 + rate_2
    return (
        length_1 * one[1] + distance * both[1],
        length_1 * one[0] + distance * both[0],
        -length_1 * one[0] * rate_1 - distance * both[0] * rate_12,
        length_1 * one[1] * rate_1 + distance * both[1] * rate_12,
    )


def prepare_law(arena: Arena, clock: Clock, header: Words, i: int) -> None:
    """Delays of lane i in the paper's law."""
    for r in range(2):
        late = arena[row.SENSOR_DELAY + r, i] if variant.law_on_sensor else 0.0
        shared = arena[row.SENSOR_DELAY, i]
        command = 0.0 if header[word.COMPENSATION] == 0 else shared if header[word.COMPENSATION] == 1 else late
        arena[row.DELAY + r, i] = late
        arena[row.COMMAND_DELAY + r, i] = command
        arena[row.WEIGHT + r, i] = 1.0
        arena[row.RATE_WEIGHT + r, i] = 1.0
        arena[row.NOISE + r, i] = 0.0
    arena[row.GAIN, i] = 0.0
    invalidate_segment(arena, row.COMMAND_SEGMENT, i)


def start_law(arena: Arena, history: History, clock: Clock, paths: Paths, settings: Table, started: Mask) -> None:
    """Complete the started lanes for the implicit integrator; the others keep what they had."""
    for at in range(STAGES * variant.size):  # what an earlier episode left, at worst not finite
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
    request: ResetRequest,
    lane: int,
    i: int,
) -> None:
    """Everything of lane i but its delay line."""
    draw_quantities(arena, key, settings, request, i)
    moving = draw_start(arena, clock, key, paths, settings, request, lane, i)
    initial_state(arena, clock, key, paths, settings, request, i, moving)
    newest = row.TAIL + 2 * header[word.PREVIEWS]
    for at in range(header[word.KEPT_ACTIONS] * header[word.CHANNELS]):
        arena[newest + at, i] = -1.0 if variant.law else 0.0  # no torque, no gain
    invalidate_segment(arena, row.PRESENT_SEGMENT, i)
    arena[row.ACTION_CHANGE, i] = 0.0
    arena[row.EFFECTIVE_GAIN, i] = 0.0
    arena[row.ELBOW_SIDE, i] = 0.0
    arena[row.ELBOW_CHANGES, i] = 0.0
    arena[row.SUCCESS, i] = 0.0
    arena[row.AWAY, i] = (clock[clock_row.STEPS, i] - 1) * settings[setting.STEP]
    for r in range(2):
        arena[row.TORQUE + r, i] = 0.0
        arena[row.SENSOR_ERROR + r, i] = 0.0
    if variant.tracking:
        arena[row.SHIFT, i] = 0.0
        arena[row.SHIFT + 1, i] = 0.0


def seed_sensor(arena: Arena, history: History, clock: Clock, paths: Paths, settings: Table, i: int) -> None:
    """A reading from before the start of lane i, so that the first one has a change per second."""
    h = settings[setting.STEP]
    late = arena[row.SENSOR_DELAY, i]
    later = arena[row.SENSOR_DELAY + 1, i] - late
    late += max(settings[setting.PERIOD], settings[setting.HOLD])
    taken = clock[clock_row.STEPS, i] * h - late
    point = sensed_point(arena, history, clock, settings, i, late, late + later)
    reference = reference_at(paths, clock[clock_row.PATH, i], taken, taken + 1e-9 * h, clock[clock_row.SINCE, i] * h)
    for r in range(2):
        arena[row.LINK_SENSOR + r, i] = point[r]
        arena[row.SENSOR_ERROR + r, i] = reference[r] - point[r]
        arena[row.SENSOR_ERROR_RATE + r, i] = 0.0
    arena[row.SAMPLE_TIME, i] = taken


@inlined_in_its_caller
def reset_lanes(
    arena: Arena,
    history: History,
    clock: Clock,
    keys: Keys,
    paths: Paths,
    header: Words,
    settings: Table,
    reset_requests: ResetRequests,
    first: int,
    started: Mask,
) -> None:
    """Begin episodes in some lanes of a block, up to the first look; the others stay as they are.

    Args:
        arena: of the block.
        history: readings at past steps.
        clock: of each lane.
        keys: of the episodes, new ones where one begins. Shape (lanes,).
        paths: of all lanes. Shape (paths, n, 5).
        header: see `entries.Header`.
        settings: see `entries.Setting`.
        reset_requests: see `entries.Column`. Shape (blocks * lanes, columns).
        first: lane of the block among all.
        started: which lanes begin an episode. Shape (lanes,).
    """
    for i in range(variant.lanes):
        if started[i]:
            lane = first + i
            reset_lane(arena, clock, keys[i], paths, header, settings, reset_requests[lane], lane, i)
            if variant.law:
                prepare_law(arena, clock, header, i)
    if not variant.foreshortened:
        elimination_kernel(arena)
    store_reading(arena, history, clock[clock_row.HEAD, 0])  # where none begins it was there, or nobody asks for it
    for i in range(variant.lanes):
        if started[i]:
            moving = clock[clock_row.SINCE, i] == LONG_AGO
            fill_history(arena, history, clock, paths, header, settings, i, moving)
            seed_sensor(arena, history, clock, paths, settings, i)
