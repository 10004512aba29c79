"""Drivers of the further sensors; each is at a point of either link and measures a quantity (`sensing.Quantity`).

It has one reading for each control instant, with a delay, noise, bias and range of its own. The first ones read
positions, whose error is known. `imex` explains lanes, blocks and arenas; `envs.sensors` declares the sensors.
"""

from __future__ import annotations

import numpy as np

from flexarm_env.codegen.arrays import Arena, Four, Keys
from flexarm_env.codegen.declarations import per_lane
from flexarm_env.codegen.elementary import normal_pair
from flexarm_env.codegen.scalars import clip
from flexarm_env.episode.sensor import noise_place, point_on_reference
from flexarm_env.kernels.delay_line import delayed_number, delayed_reading
from flexarm_env.kernels.entries import READING_ROWS, clock_row, setting
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import Block, variant
from flexarm_env.physics.polyline import reference_at


def sense_further(block: Block) -> None:
    """Read the further sensors in a block's lanes, and compute the errors of the positions that they read.

    An error is the position of the same point of the rigid arm on the reference at that time, minus the reading; of
    the declared point and delay, whatever the episode has.
    """
    arena, active = block.arena, block.active
    for i in range(variant.lanes):
        if active[i]:
            for r in range(variant.further_readings):
                arena[row.FURTHER_READING + r, i] = further_reading(block, i, r)
            for n in range(variant.further_points):
                late, distance = arena[row.NOMINAL_FURTHER_DELAY + n, i], arena[row.NOMINAL_FURTHER_DISTANCE + n, i]
                there = further_reference(block, i, n, distance, late)
                for r in range(2):
                    read = arena[row.FURTHER_READING + 2 * n + r, i]
                    arena[row.FURTHER_ERROR + 2 * n + r, i] = there[r] - read


@per_lane
def further_reading(block: Block, i: int, r: int) -> float:
    """Return the number r that the further sensors of lane i read now."""
    settings, arena, history, clock, keys = block.settings, block.arena, block.history, block.clock, block.keys
    slots = history.shape[0] // variant.slot_rows
    slot = clock[clock_row.HEAD, 0]
    h, late = settings[setting.STEP], arena[row.FURTHER_DELAY + r, i]
    if r < 2 * variant.further_points:
        at = READING_ROWS * (1 + r // 2) + r % 2
        read = delayed_reading(history, slots, slot, i, at, h, late / h)[0]
    else:
        at = READING_ROWS + 2 * variant.further_points + r
        read = delayed_number(history, slots, slot, i, at, late / h)
    if variant.disturbed:
        bias, deviation = arena[row.FURTHER_BIAS + r, i], arena[row.FURTHER_NOISE + r, i]
        if bias != 0.0:
            read += bias
        if deviation > 0.0:
            read += deviation * deviate(keys[i], noise_place(block, i) + int(arena[row.FURTHER_DRAW + r, i]))
    return clip(read, -arena[row.FURTHER_RANGE + r, i], arena[row.FURTHER_RANGE + r, i])


def deviate(key: np.uint64, place: int) -> float:
    """Return the standard normal deviate of a place; two places, the first of them even, share a pair."""
    pair = normal_pair(key, place - place % 2)
    return pair[place % 2]


def draw_biases(arena: Arena, keys: Keys, i: int) -> None:
    """Draw the biases of lane i's episode, at the places before those of the noise."""
    for r in range(variant.further_readings):
        spread = arena[row.FURTHER_BIAS_SPREAD + r, i]
        arena[row.FURTHER_BIAS + r, i] = 0.0
        if spread > 0.0:
            arena[row.FURTHER_BIAS + r, i] = spread * deviate(keys[i], int(arena[row.FURTHER_DRAW + r, i]))


def further_reference(block: Block, i: int, n: int, distance: float, back: float) -> Four:
    """Return position and velocity, `back` seconds ago, of a sensor's point of the rigid arm on lane i's reference.

    Args:
        block: the block.
        i: the lane.
        n: the further sensor.
        distance: of the point from the root of the sensor's link [m].
        back: how long ago [s].
    """
    settings, arena, clock, paths = block.settings, block.arena, block.clock, block.paths
    h = settings[setting.STEP]
    time = clock[clock_row.STEPS, i] * h - back
    since = clock[clock_row.SINCE, i] * h
    if variant.racing:  # as `update_sensor_error`
        time, since = arena[row.START_TIME, i] + arena[row.PROGRESS, i], -1e18
    reference = reference_at(paths, clock[clock_row.PATH, i], time, time + 1e-9 * h, since)
    link = int(arena[row.FURTHER_LINK + n, i])
    return point_on_reference(settings, arena[row.BRANCH, i], link, distance, reference)
