"""Drivers that begin episodes: what is drawn for them, where the arm starts, and what its delay line holds.

Assembled and compiled like `stepping`, which explains lanes, blocks and arenas.
"""

from __future__ import annotations

from math import floor, sqrt
from typing import Any

from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.random_stream import uniform
from flexarm_env.episode.sensor import sensed_point
from flexarm_env.kernels.imex import (
    BEGAN,
    HEAD,
    PATH,
    SINCE,
    STEPS,
    law_kernel,
    prepare_commands,
    prepare_readings,
    store_reading,
)
from flexarm_env.kernels.path_cache import forget_side, reference_at
from flexarm_env.physics.inverse_kinematics import joint_angles_for, joint_rates_for

LANES = 1
SIZE = 4
MODES = 1
STAGES = 4
STEP = PERIOD = LENGTHS = BRANCH = START_SPREAD = SENSOR_DELAYS = BASE = LOWEST = HIGHEST = ARM = PER_PAYLOAD = 0
PER_DAMPING = SUBSTEPS = CHANNELS = KEPT_ACTIONS = PREVIEWS = COMPENSATION = TIP_VALUES = K_ELBOW_VALUES = 0
TAIL = EPISODE = Y = V = CONSTANTS = SENSOR_DELAY = SAMPLE_TIME = SENSOR_ERROR = SENSOR_ERROR_RATE = K_ELBOW_SLOPES = 0
PLACE_DISTANCE = JOINT = SHIFT = DELAY = COMMAND_DELAY = WEIGHT = RATE_WEIGHT = GAIN = EFFECTIVE_GAIN = TORQUE = 0
V_SLOTS = MECHANICAL_SLOTS = FEEDBACK_SLOTS = V_STAGE = MECHANICAL = FEEDBACK = ACTION_CHANGE = NOISE = 0
MOVES = LAP = START_TIME = PRESENT_SIDE = COMMAND_SIDE = READINGS = HOLD = SENSED = K_STIFFNESS_1 = K_DAMPING_1 = 0
CONSTANT_COUNT = 0  # numbers that the equations know of an arm
OWN_PATHS = TRUE_SENSOR = LATE = LAW = TRACKING = LINEAR = False
# Constants of this file that assembled modules repeat.
TABLES = (
    *("CORNER", "CORNERS", "MOVING", "MIX", "SHARE_AT_REST", "LONG_AGO"),
    *("PLACE_PATH", "PLACE_MIX", "PLACE_PHASE", "PLACE_SPREAD", "PLACE_DRAWN", "PLACE_MOVE"),
)
# Columns of an order (`rows.ORDER`), and how many quantities are drawn for an episode (`rows.DRAWN`).
START = PHASE_ORDER = PATH_ORDER = DRAWN_ORDER = STATE_ORDER = QUANTITIES = 0
DRAWN_DELAY = DRAWN_PAYLOAD_MASS = DRAWN_STIFFNESS = DRAWN_DAMPING = 0  # places among them
CORNER, CORNERS, MOVING, MIX = 0.0, 1.0, 2.0, 3.0  # how an episode starts
SHARE_AT_REST = 0.3  # of the mix
LONG_AGO = -(2**60)  # [steps]; since then the reference has been moving
# Which of an episode's random numbers its start uses.
PLACE_PATH, PLACE_MIX, PLACE_PHASE = 0, 1, 2
PLACE_SPREAD, PLACE_DRAWN, PLACE_MOVE = 8, 16, 32


def elimination_kernel(arena: Any) -> None:
    """What `elimination` knows of every lane's arm, with linear kinematics (recorded)."""
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def draw_quantities(arena: Any, key: Any, settings: Any, order: Any, i: int) -> None:
    """What is drawn for lane i's episode, unless the order names it, and the arm that follows from it."""
    for n in range(QUANTITIES):
        value = settings[BASE + n]
        low = settings[LOWEST + n]
        if low == low:
            value = low + (settings[HIGHEST + n] - low) * uniform(key, PLACE_DRAWN + n)
        if order[DRAWN_ORDER + n] == order[DRAWN_ORDER + n]:
            value = order[DRAWN_ORDER + n]
        arena[i + (EPISODE + n) * LANES] = value
    payload = arena[i + (EPISODE + DRAWN_PAYLOAD_MASS) * LANES] - settings[BASE + DRAWN_PAYLOAD_MASS]
    stiffness = arena[i + (EPISODE + DRAWN_STIFFNESS) * LANES]
    # modal damping is 2 zeta omega m, and omega grows with the root of the stiffness
    ratio = arena[i + (EPISODE + DRAWN_DAMPING) * LANES]
    damping = ratio * sqrt(stiffness) - settings[BASE + DRAWN_DAMPING]
    for n in range(CONSTANT_COUNT):
        value = settings[ARM + n] + payload * settings[PER_PAYLOAD + n] + damping * settings[PER_DAMPING + n]
        if K_STIFFNESS_1 <= n < K_DAMPING_1:
            value *= stiffness
        arena[i + (CONSTANTS + n) * LANES] = value
    delay = arena[i + (EPISODE + DRAWN_DELAY) * LANES]
    for r in range(2):
        late = delay if delay == delay else settings[SENSOR_DELAYS + r]
        arena[i + (SENSOR_DELAY + r) * LANES] = late
    arena[i + (EPISODE + DRAWN_DELAY) * LANES] = arena[i + SENSOR_DELAY * LANES]


def draw_start(arena: Any, clock: Any, key: Any, paths: Any, settings: Any, order: Any, lane: int, i: int) -> bool:
    """Path and moment at which lane i starts; whether the arm starts on the move."""
    index = int(uniform(key, PLACE_PATH) * paths.shape[0])
    if OWN_PATHS:  # a constant: where it is false, the compiler never sees what follows
        index = lane
        draw_moves(paths[lane], key, settings)
    elif order[PATH_ORDER] == order[PATH_ORDER]:
        index = int(order[PATH_ORDER])
    lap = paths[index, paths.shape[1] - 1, 0]
    kind = order[START]
    if kind == MIX:
        kind = CORNERS if uniform(key, PLACE_MIX) < SHARE_AT_REST else MOVING
    phase = 0.0
    if kind == CORNERS:
        phase = 0.25 * lap * floor(4.0 * uniform(key, PLACE_PHASE))
    elif kind == MOVING:
        phase = settings[PERIOD] * floor(uniform(key, PLACE_PHASE) * lap / settings[PERIOD])
    if order[PHASE_ORDER] == order[PHASE_ORDER]:
        phase = order[PHASE_ORDER]
    clock[PATH, i] = index
    clock[STEPS, i] = int(phase / settings[STEP] + 0.5)
    clock[BEGAN, i] = clock[STEPS, i]
    arena[i + START_TIME * LANES] = clock[BEGAN, i] * settings[STEP]
    moving = kind == MOVING
    clock[SINCE, i] = LONG_AGO if moving else clock[STEPS, i]
    return moving


def drawn_point(key: Any, settings: Any, place: int) -> tuple[float, float]:
    """Joint angles that put the tip at a point drawn from the ring `MOVES`, by two random numbers from a place on."""
    low, high = settings[MOVES], settings[MOVES + 1]
    radius = sqrt(low * low + (high * high - low * low) * uniform(key, place))  # evenly by area
    turn = sincos(6.283185307179586 * uniform(key, place + 1))
    x, y = radius * turn[1], radius * turn[0]
    return joint_angles_for(settings[LENGTHS], settings[LENGTHS + 1], settings[BRANCH], x, y)


def draw_moves(path: Any, key: Any, settings: Any) -> None:
    """A path of an episode's own: from one point to another and back, each move from rest to rest, then a rest.

    The joint angles run together along a polynomial of fifth degree (minimum jerk); points are drawn in the ring that
    `MOVES` sets, theta1's way is the shorter one.

    Args:
        path: to be filled; evenly timed, see `sides.reference_at`. Shape (n, 5).
        key: of the episode.
        settings: see `rows.SETTINGS`.
    """
    start = drawn_point(key, settings, PLACE_MOVE)
    end = drawn_point(key, settings, PLACE_MOVE + 2)
    way_1 = end[0] - start[0]
    way_1 -= 6.283185307179586 * floor(way_1 / 6.283185307179586 + 0.5)
    way_2 = end[1] - start[1]
    last = path.shape[0] - 1
    lap = settings[LAP]
    for n in range(last + 1):
        quarters = 4.0 * n / last  # a move, a rest, a move back, a rest
        u = min(max(quarters if quarters < 2.0 else 3.0 - quarters, 0.0), 1.0)
        share = u * u * u * (10.0 + u * (6.0 * u - 15.0))
        one = sincos(start[0] + share * way_1)
        both = sincos(start[0] + share * way_1 + start[1] + share * way_2)
        path[n, 0] = lap * (n / last)
        path[n, 1] = settings[LENGTHS] * one[1] + settings[LENGTHS + 1] * both[1]
        path[n, 2] = settings[LENGTHS] * one[0] + settings[LENGTHS + 1] * both[0]
    for n in range(last):
        per_second = 1.0 / (path[n + 1, 0] - path[n, 0])
        path[n, 3] = (path[n + 1, 1] - path[n, 1]) * per_second
        path[n, 4] = (path[n + 1, 2] - path[n, 2]) * per_second


def place_arm(arena: Any, clock: Any, key: Any, paths: Any, settings: Any, order: Any, i: int, moving: bool) -> None:
    """State of lane i: as ordered, or the rigid arm on the reference, on the move a little off it."""
    now = clock[STEPS, i] * settings[STEP]
    reference = reference_at(paths, clock[PATH, i], now, now + 1e-9 * settings[STEP], -1e18)
    length_1, length_2 = settings[LENGTHS], settings[LENGTHS + 1]
    theta1, theta2 = joint_angles_for(length_1, length_2, settings[BRANCH], reference[0], reference[1])
    rate_1, rate_2 = 0.0, 0.0
    if moving:
        rate_1, rate_2 = joint_rates_for(length_1, length_2, theta1, theta2, reference[2], reference[3])
        theta1 += settings[START_SPREAD] * (2.0 * uniform(key, PLACE_SPREAD) - 1.0)
        theta2 += settings[START_SPREAD] * (2.0 * uniform(key, PLACE_SPREAD + 1) - 1.0)
    given = order[STATE_ORDER] == order[STATE_ORDER]
    for r in range(2 * SIZE):
        part = V if r >= SIZE else Y
        entry = r % SIZE
        value = order[STATE_ORDER + r] if given else 0.0
        if not given and entry < 2:
            value = (theta1, theta2, rate_1, rate_2)[2 * (r // SIZE) + entry]
        if not given and moving and r < SIZE and (entry == 2 or entry == 2 + MODES):  # the links' first modes
            link = 0 if entry == 2 else 1
            tip = arena[i + (CONSTANTS + K_ELBOW_VALUES if link == 0 else TIP_VALUES) * LANES]
            value = settings[START_SPREAD + 1] / tip * (2.0 * uniform(key, PLACE_SPREAD + 2 + link) - 1.0)
        # from the public order (theta1, theta2, q1, q2) to the internal one (a1, q1, a2, q2)
        row = 0 if entry == 0 else SIZE // 2 if entry == 1 else entry - 1 if entry < 2 + MODES else entry
        arena[i + (part + row) * LANES] = value
    for part in (Y, V):
        slope = 0.0
        for n in range(MODES):
            slope += arena[i + (CONSTANTS + K_ELBOW_SLOPES + n) * LANES] * arena[i + (part + 1 + n) * LANES]
        turn = arena[i + part * LANES] + slope + arena[i + (part + SIZE // 2) * LANES]
        arena[i + (part + SIZE // 2) * LANES] = turn
    arena[i + JOINT * LANES] = arena[i + Y * LANES]  # the joint aim stays within half a turn of it


def fill_history(
    arena: Any, history: Any, clock: Any, paths: Any, plan: Any, settings: Any, i: int, moving: bool
) -> None:
    """The delay line of lane i: its newest reading, moved back with the reference if the arm starts on the move."""
    h = settings[STEP]
    slots = history.shape[0] // (4 * LANES)
    newest = clock[HEAD, 0]
    now = reference_reading(arena, clock, paths, settings, i, 0.0)
    for back in range(slots):
        if not (plan[READINGS] >> (-back % plan[SUBSTEPS] & 63)) & 1:
            continue  # nobody will ask for it
        slot = (newest - back) % slots
        moved = reference_reading(arena, clock, paths, settings, i, back * h) if moving and back > 0 else now
        for r in range(4):
            value = history[i + (4 * newest + r) * LANES]
            if moving:
                value += moved[r] - now[r]
            elif r >= 2 and back > 0:
                value = 0.0  # before the start nothing moved
            history[i + (4 * slot + r) * LANES] = value


def reference_reading(
    arena: Any, clock: Any, paths: Any, settings: Any, i: int, back: float
) -> tuple[float, float, float, float]:
    """What the sensor would read on the rigid arm that is on lane i's reference, some seconds ago; with rates."""
    time = clock[STEPS, i] * settings[STEP] - back
    x, y, vx, vy = reference_at(paths, clock[PATH, i], time, time + 1e-9 * settings[STEP], -1e18)
    length_1, length_2 = settings[LENGTHS], settings[LENGTHS + 1]
    if TRUE_SENSOR and arena[i + PLACE_DISTANCE * LANES] == length_2:  # it is the tip that is on the reference
        return x, y, vx, vy
    theta1, theta2 = joint_angles_for(length_1, length_2, settings[BRANCH], x, y)
    rate_1, rate_2 = joint_rates_for(length_1, length_2, theta1, theta2, vx, vy)
    if not TRUE_SENSOR:
        near = arena[i + JOINT * LANES]
        return theta1 + 6.283185307179586 * floor((near - theta1) / 6.283185307179586 + 0.5), theta2, rate_1, rate_2
    distance = arena[i + PLACE_DISTANCE * LANES]
    one, both = sincos(theta1), sincos(theta1 + theta2)
    rate_12 = rate_1 + rate_2
    return (
        length_1 * one[1] + distance * both[1],
        length_1 * one[0] + distance * both[0],
        -length_1 * one[0] * rate_1 - distance * both[0] * rate_12,
        length_1 * one[1] * rate_1 + distance * both[1] * rate_12,
    )


def prepare_law(arena: Any, clock: Any, plan: Any, i: int) -> None:
    """Delays of lane i in the paper's law."""
    for r in range(2):
        late = arena[i + (SENSOR_DELAY + r) * LANES] if LATE else 0.0
        shared = arena[i + SENSOR_DELAY * LANES]
        command = 0.0 if plan[COMPENSATION] == 0 else shared if plan[COMPENSATION] == 1 else late
        arena[i + (DELAY + r) * LANES] = late
        arena[i + (COMMAND_DELAY + r) * LANES] = command
        arena[i + (WEIGHT + r) * LANES] = 1.0
        arena[i + (RATE_WEIGHT + r) * LANES] = 1.0
        arena[i + (NOISE + r) * LANES] = 0.0
    arena[i + GAIN * LANES] = 0.0
    forget_side(arena, COMMAND_SIDE, i)


def start_law(arena: Any, history: Any, clock: Any, paths: Any, settings: Any, started: Any) -> None:
    """Complete the started lanes for the implicit integrator; the others keep what they had."""
    for row in range(STAGES * SIZE):  # what an earlier episode left, at worst not finite
        for i in range(LANES):
            if started[i]:
                arena[i + (V_SLOTS + row) * LANES] = 0.0
                arena[i + (MECHANICAL_SLOTS + row) * LANES] = 0.0
                arena[i + (FEEDBACK_SLOTS + row) * LANES] = 0.0
    # as `evaluate_law`, but the other lanes keep the torques of the start of their period
    prepare_commands(arena, clock, paths, settings[STEP])
    prepare_readings(arena, history, clock, settings[STEP], 0.0)
    law_kernel(arena, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    for r in range(SIZE):
        for i in range(LANES):
            if started[i]:
                arena[i + (V_SLOTS + r) * LANES] = arena[i + (V_STAGE + r) * LANES]
                arena[i + (MECHANICAL_SLOTS + r) * LANES] = arena[i + (MECHANICAL + r) * LANES]
                arena[i + (FEEDBACK_SLOTS + r) * LANES] = arena[i + (FEEDBACK + r) * LANES]


def start_lane(
    arena: Any, clock: Any, key: Any, paths: Any, plan: Any, settings: Any, order: Any, lane: int, i: int
) -> None:
    """Everything of lane i but its delay line."""
    draw_quantities(arena, key, settings, order, i)
    moving = draw_start(arena, clock, key, paths, settings, order, lane, i)
    place_arm(arena, clock, key, paths, settings, order, i, moving)
    newest = TAIL + 2 * plan[PREVIEWS]
    for row in range(plan[KEPT_ACTIONS] * plan[CHANNELS]):
        arena[i + (newest + row) * LANES] = -1.0 if LAW else 0.0  # no torque, no gain
    forget_side(arena, PRESENT_SIDE, i)
    arena[i + ACTION_CHANGE * LANES] = 0.0
    arena[i + EFFECTIVE_GAIN * LANES] = 0.0
    for r in range(2):
        arena[i + (TORQUE + r) * LANES] = 0.0
        arena[i + (SENSOR_ERROR + r) * LANES] = 0.0
    if TRACKING:
        arena[i + SHIFT * LANES] = 0.0
        arena[i + (SHIFT + 1) * LANES] = 0.0


def first_sample(arena: Any, history: Any, clock: Any, paths: Any, settings: Any, i: int) -> None:
    """A reading from before the start of lane i, so that the first one has a change per second."""
    h = settings[STEP]
    late = arena[i + SENSOR_DELAY * LANES]
    later = arena[i + (SENSOR_DELAY + 1) * LANES] - late
    late += max(settings[PERIOD], settings[HOLD])
    taken = clock[STEPS, i] * h - late
    point = sensed_point(arena, history, clock, settings, i, late, late + later)
    reference = reference_at(paths, clock[PATH, i], taken, taken + 1e-9 * h, clock[SINCE, i] * h)
    for r in range(2):
        arena[i + (SENSED + r) * LANES] = point[r]
        arena[i + (SENSOR_ERROR + r) * LANES] = reference[r] - point[r]
        arena[i + (SENSOR_ERROR_RATE + r) * LANES] = 0.0
    arena[i + SAMPLE_TIME * LANES] = taken


def begin_lanes(
    arena: Any,
    history: Any,
    clock: Any,
    keys: Any,
    paths: Any,
    plan: Any,
    settings: Any,
    orders: Any,
    first: int,
    started: Any,
) -> None:
    """Begin episodes in some lanes of a block, up to the first look; the others stay as they are.

    Args:
        arena: of the block.
        history: readings at past steps.
        clock: of each lane.
        keys: of the episodes, new ones where one begins. Shape (LANES,).
        paths: of all lanes. Shape (paths, n, 5).
        plan: see `rows.PLAN`.
        settings: see `rows.SETTINGS`.
        orders: see `rows.ORDER`. Shape (blocks * LANES, columns).
        first: lane of the block among all.
        started: which lanes begin an episode. Shape (LANES,).
    """
    for i in range(LANES):
        if started[i]:
            lane = first + i
            start_lane(arena, clock, keys[i], paths, plan, settings, orders[lane], lane, i)
            if LAW:
                prepare_law(arena, clock, plan, i)
    if LINEAR:
        elimination_kernel(arena)
    store_reading(arena, history, clock[HEAD, 0])  # where none begins it was there, or nobody asks for it
    for i in range(LANES):
        if started[i]:
            moving = clock[SINCE, i] == LONG_AGO
            fill_history(arena, history, clock, paths, plan, settings, i, moving)
            first_sample(arena, history, clock, paths, settings, i)
