"""Drivers that fill the delay line and the sensor's last reading with values from before an episode begins.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

from numpy import floor

from flexarm_env.codegen.arrays import Four
from flexarm_env.episode.further_sensors import draw_biases, further_reference
from flexarm_env.episode.initial_conditions import is_moving
from flexarm_env.episode.sensor import joint_motion, point_on_reference
from flexarm_env.kernels.block import Block
from flexarm_env.kernels.delay_line import is_kept, sensed_point
from flexarm_env.kernels.entries import READING_ROWS, clock_row, setting
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import variant
from flexarm_env.physics.polyline import reference_at


def move_history(block: Block, i: int) -> None:
    """Fill the delay line of lane i, whose arm starts on the move: positions as of the newest ones moved back in time.

    Before the start, sensors of other quantities read what they read at the start (`delay_line.fill_history`).
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
        return further_reference(block, i, s - 1, back)
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
    return theta1 + 6.283185307179586 * floor((near - theta1) / 6.283185307179586 + 0.5), theta2, rate_1, rate_2


def seed_sensor(block: Block, i: int) -> None:
    """Set a reading from before the start of lane i, so that the change per second of the first one is defined."""
    settings, arena, clock, paths = block.settings, block.arena, block.clock, block.paths
    h = settings[setting.STEP]
    late = arena[row.SENSOR_DELAY, i]
    later = arena[row.SENSOR_DELAY + 1, i] - late
    late += max(settings[setting.PERIOD], arena[row.HOLD, i])
    taken = clock[clock_row.STEPS, i] * h - late
    point = sensed_point(block, i, late, late + later)
    reference = reference_at(paths, clock[clock_row.PATH, i], taken, taken + 1e-9 * h, clock[clock_row.SINCE, i] * h)
    for r in range(2):
        arena[row.LINK_SENSOR + r, i] = point[r]
        arena[row.SENSOR_ERROR + r, i] = reference[r] - point[r]
        arena[row.SENSOR_ERROR_RATE + r, i] = 0.0
    arena[row.SAMPLE_TIME, i] = taken
