"""Drivers that fill the delay line and the sensor's last reading with values from before an episode begins.

`imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

from numpy import floor

from flexarm_env.codegen.arrays import Arena, Clock, Four, History, Mask, Paths, Table, Words
from flexarm_env.episode.draws import is_moving
from flexarm_env.episode.second_sensor import second_reference
from flexarm_env.episode.sensor import joint_motion, point_on_reference
from flexarm_env.kernels.delay_line import is_kept, sensed_point
from flexarm_env.kernels.entries import clock_row, setting
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import variant
from flexarm_env.physics.polyline import reference_at


def move_history(
    arena: Arena, history: History, clock: Clock, paths: Paths, header: Words, settings: Table, i: int
) -> None:
    """Fill the delay line of lane i, whose arm starts on the move, with its newest readings moved back in time."""
    h = settings[setting.STEP]
    slots = history.shape[0] // variant.slot_rows
    newest = clock[clock_row.HEAD, 0]
    now = reference_slot(arena, clock, paths, settings, i, 0.0)
    for back in range(1, slots):
        if is_kept(header, -back):
            slot = (newest - back) % slots
            then = reference_slot(arena, clock, paths, settings, i, back * h)
            for r in range(variant.slot_rows):
                moved = then[r] - now[r]
                history[variant.slot_rows * slot + r, i] = history[variant.slot_rows * newest + r, i] + moved


def begin_sensors(
    arena: Arena, history: History, clock: Clock, paths: Paths, header: Words, settings: Table, started: Mask
) -> None:
    """Complete what the sensors of the lanes that begin an episode have read before, see `sensor.sense`."""
    for i in range(variant.lanes):
        if started[i]:
            if is_moving(clock, i):
                move_history(arena, history, clock, paths, header, settings, i)
            seed_sensor(arena, history, clock, paths, settings, i)


def reference_slot(arena: Arena, clock: Clock, paths: Paths, settings: Table, i: int, back: float) -> tuple[float, ...]:
    """Return what all sensors would have read `back` seconds ago on the rigid arm on lane i's reference, with rates."""
    first = reference_reading(arena, clock, paths, settings, i, back)
    if variant.second_sensor:
        return first + second_reference(arena, clock, paths, settings, i, back)
    return first


def reference_reading(arena: Arena, clock: Clock, paths: Paths, settings: Table, i: int, back: float) -> Four:
    """Return what the sensor would have read `back` seconds ago on the rigid arm on lane i's reference, with rates."""
    time = clock[clock_row.STEPS, i] * settings[setting.STEP] - back
    reference = reference_at(paths, clock[clock_row.PATH, i], time, time + 1e-9 * settings[setting.STEP], -1e18)
    if variant.true_sensor:
        return point_on_reference(settings, arena[row.BRANCH, i], 2, arena[row.SENSOR_POINT_DISTANCE, i], reference)
    theta1, theta2, rate_1, rate_2 = joint_motion(settings, arena[row.BRANCH, i], reference)
    near = arena[row.REFERENCE_JOINTS, i]
    return theta1 + 6.283185307179586 * floor((near - theta1) / 6.283185307179586 + 0.5), theta2, rate_1, rate_2


def seed_sensor(arena: Arena, history: History, clock: Clock, paths: Paths, settings: Table, i: int) -> None:
    """Set a reading from before the start of lane i, so that the change per second of the first one is defined."""
    h = settings[setting.STEP]
    late = arena[row.SENSOR_DELAY, i]
    later = arena[row.SENSOR_DELAY + 1, i] - late
    late += max(settings[setting.PERIOD], arena[row.HOLD, i])
    taken = clock[clock_row.STEPS, i] * h - late
    point = sensed_point(arena, history, clock, settings, i, late, late + later)
    reference = reference_at(paths, clock[clock_row.PATH, i], taken, taken + 1e-9 * h, clock[clock_row.SINCE, i] * h)
    for r in range(2):
        arena[row.LINK_SENSOR + r, i] = point[r]
        arena[row.SENSOR_ERROR + r, i] = reference[r] - point[r]
        arena[row.SENSOR_ERROR_RATE + r, i] = 0.0
    arena[row.SAMPLE_TIME, i] = taken
