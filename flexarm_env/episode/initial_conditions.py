"""Drivers that draw an episode: its quantities, the constants of its arm, its path, and where and how it starts.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy import floor

from flexarm_env.codegen.arrays import Arena, Clock, Path, ResetRequest, Table, Words
from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.random_stream import uniform
from flexarm_env.kernels.block import Block
from flexarm_env.kernels.entries import QUANTITIES, clock_row, column, constant, drawn, lane_setting, setting, word
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import variant
from flexarm_env.physics.inverse_kinematics import joint_angles_for

CORNER, CORNERS, MOVING, MIX = 0.0, 1.0, 2.0, 3.0  # how an episode starts
SHARE_AT_REST = 0.3  # of the mix
LONG_AGO = -(2**60)  # [steps]; since then the reference has been moving
# Which of an episode's random numbers its start uses.
PLACE_PATH, PLACE_MIX, PLACE_PHASE, PLACE_BRANCH, PLACE_DIRECTION = 0, 1, 2, 3, 4
PLACE_SPREAD, PLACE_DRAWN, PLACE_MOVE = 8, 16, 32


def draw_quantities(arena: Arena, key: np.uint64, own: Table, request: ResetRequest, i: int) -> None:
    """Draw the quantities of lane i's episode that the request leaves open, and compute the arm's constants."""
    for n in range(QUANTITIES):
        value = own[lane_setting.BASE + n]
        low = own[lane_setting.LOWEST + n]
        if low == low:
            value = low + (own[lane_setting.HIGHEST + n] - low) * uniform(key, PLACE_DRAWN + n)
        if request[column.DRAWN + n] == request[column.DRAWN + n]:
            value = request[column.DRAWN + n]
        arena[row.EPISODE + n, i] = value
    payload = arena[row.EPISODE + drawn.PAYLOAD_MASS, i] - own[lane_setting.BASE + drawn.PAYLOAD_MASS]
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


def draw_path(key: np.uint64, header: Words, own: Table, request: ResetRequest) -> int:
    """Return the index of the path that an episode follows: name and direction by the request or a draw."""
    index = int(uniform(key, PLACE_PATH) * header[word.PATH_NAMES])
    if request[column.PATH] == request[column.PATH]:
        index = int(request[column.PATH])
    direction = own[lane_setting.DIRECTION]
    if request[column.DIRECTION] == request[column.DIRECTION]:
        direction = request[column.DIRECTION]
    if direction < 0.0:
        direction = floor(2.0 * uniform(key, PLACE_DIRECTION))
    return index + int(direction) * header[word.PATH_NAMES]


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
    clock[clock_row.STEPS, i] = int(phase / settings[setting.STEP] + 0.5)
    clock[clock_row.BEGAN, i] = clock[clock_row.STEPS, i]
    clock[clock_row.SINCE, i] = LONG_AGO if kind == MOVING else clock[clock_row.STEPS, i]
    arena[row.START_TIME, i] = clock[clock_row.BEGAN, i] * settings[setting.STEP]


def is_moving(clock: Clock, i: int) -> bool:
    """Return whether the arm of lane i starts on the move."""
    return clock[clock_row.SINCE, i] == LONG_AGO


def drawn_point(key: np.uint64, settings: Table, branch: float, place: int) -> tuple[float, float]:
    """Draw joint angles that put the tip at a point of the ring `Setting.MOVES`, by random numbers from `place` on."""
    low, high = settings[setting.MOVES], settings[setting.MOVES + 1]
    radius = sqrt(low * low + (high * high - low * low) * uniform(key, place))  # evenly by area
    turn = sincos(6.283185307179586 * uniform(key, place + 1))
    x, y = radius * turn[1], radius * turn[0]
    return joint_angles_for(settings[setting.LENGTHS], settings[setting.LENGTHS + 1], branch, x, y)


def draw_moves(path: Path, key: np.uint64, settings: Table, branch: float) -> None:
    """Draw an episode's path: from one point to another and back, each move from rest to rest with a rest after it.

    Both joint angles follow one polynomial of fifth degree (minimum jerk). The end points lie in the ring
    `Setting.MOVES`; theta1 turns the shorter way.

    Args:
        path: output; evenly timed, see `polyline.reference_at`. Shape (n, 5).
        key: key of the episode.
        settings: see `entries.Setting`.
        branch: sign of theta2.
    """
    start = drawn_point(key, settings, branch, PLACE_MOVE)
    end = drawn_point(key, settings, branch, PLACE_MOVE + 2)
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
