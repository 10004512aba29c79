"""Drivers of the second sensor, which measures the true position of a point of either link, as a camera does.

It has one reading for each control instant, with its own delay and noise. `imex` explains lanes, blocks and arenas.
"""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena, Clock, Four, History, Keys, Mask, Paths, Table, Words
from flexarm_env.codegen.random_stream import normal_pair
from flexarm_env.episode.sensor import noise_place, point_on_reference
from flexarm_env.kernels.delay_line import delayed_reading
from flexarm_env.kernels.entries import READING_ROWS, clock_row, setting
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import variant
from flexarm_env.physics.polyline import reference_at

SECOND_NOISE = 6  # place of its random numbers among those of a control period


def sense_second(
    arena: Arena, history: History, clock: Clock, keys: Keys, paths: Paths, header: Words, settings: Table, active: Mask
) -> None:
    """Read the second sensor in a block's lanes, and compute the readings' errors.

    The error is the position of the same point of the rigid arm on the reference at that time, minus the reading.

    Args: as `sensor.sense`.
    """
    h = settings[setting.STEP]
    slots = history.shape[0] // variant.slot_rows
    slot = clock[clock_row.HEAD, 0]
    for i in range(variant.lanes):
        if active[i]:
            late = arena[row.SECOND_DELAY, i]
            x, _ = delayed_reading(history, slots, slot, i, READING_ROWS, h, late / h)
            y, _ = delayed_reading(history, slots, slot, i, READING_ROWS + 1, h, late / h)
            if variant.disturbed:
                deviation = arena[row.SECOND_NOISE, i]
                if deviation > 0.0:
                    noise_x, noise_y = normal_pair(keys[i], noise_place(clock, header, i) + SECOND_NOISE)
                    x += deviation * noise_x
                    y += deviation * noise_y
            there = second_reference(arena, clock, paths, settings, i, late)
            arena[row.SECOND_SENSED, i] = x
            arena[row.SECOND_SENSED + 1, i] = y
            arena[row.SECOND_ERROR, i] = there[0] - x
            arena[row.SECOND_ERROR + 1, i] = there[1] - y


def second_reference(arena: Arena, clock: Clock, paths: Paths, settings: Table, i: int, back: float) -> Four:
    """Return position and velocity, `back` seconds ago, of the sensor's point of the rigid arm on lane i's reference.

    Args:
        arena: arena of one block.
        clock: clock of each lane.
        paths: paths of all lanes.
        settings: see `entries.Setting`.
        i: the lane.
        back: how long ago [s].
    """
    h = settings[setting.STEP]
    time = clock[clock_row.STEPS, i] * h - back
    reference = reference_at(paths, clock[clock_row.PATH, i], time, time + 1e-9 * h, clock[clock_row.SINCE, i] * h)
    branch, distance = arena[row.BRANCH, i], arena[row.SECOND_DISTANCE, i]
    return point_on_reference(settings, branch, variant.second_sensor, distance, reference)
