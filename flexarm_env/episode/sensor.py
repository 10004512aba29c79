"""Drivers of the sensor on link 2: which reading has arrived, where it says the arm is, and its error.

Assembled and compiled like `stepping`, which explains lanes, blocks and arenas; names in capitals are rows of the
arena and places in the tables `settings` and `plan` (`rows`).
"""

from __future__ import annotations

from math import floor
from typing import Any

from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.random_stream import normal, uniform
from flexarm_env.kernels.imex import BEGAN, HEAD, PATH, SINCE, STEPS, around, between, past_reading
from flexarm_env.kernels.path_cache import reference_at

LANES = 1
STEP = PERIOD = JITTER = HOLD = DROPOUT = LENGTHS = SUBSTEPS = 0
NOISE = PLACE_DISTANCE = SENSOR_DELAY = EPISODE = SENSED = SENSOR_ERROR = SENSOR_ERROR_RATE = REFERENCE = 0
SAMPLE_TIME = SAMPLE_AGE = SAMPLE_POINT = SAMPLE_REFERENCE = SIDE_PASSED = 0
DRAWN_NOISE = 0  # place of the noise among the quantities drawn for an episode
LATE = TRUE_SENSOR = BATCH = DISTURBED = False
CHANNELS_OF_NOISE = 8  # random numbers set aside for each control period
FIRST_NOISE = 64  # random numbers set aside for the start of an episode


def sense(arena: Any, history: Any, clock: Any, keys: Any, paths: Any, plan: Any, settings: Any, who: Any) -> None:
    """Take over the latest readings that have arrived at a block's lanes: positions, errors, and the errors' change.

    A reading that is not newer than the one before by half a control period is not taken over, so that the change per
    second stays meaningful.

    Args:
        arena: of one block.
        history: readings at past steps.
        clock: of each lane.
        keys: of each lane's episode.
        paths: of all lanes.
        plan: see `rows`.
        settings: see `rows`.
        who: lanes that sense; the others have done so already. Shape (LANES,).
    """
    if BATCH and alike(arena, settings):
        sample_alike(arena, history, clock, settings, who)
    else:
        for i in range(LANES):
            arena[i + SAMPLE_AGE * LANES] = -1.0
            if who[i]:
                sample(arena, history, clock, keys, plan, settings, i)
    compare(arena, clock, paths, settings)


def alike(arena: Any, settings: Any) -> bool:
    """Whether readings are equally late in all lanes of a block, and nothing random is about them."""
    if settings[HOLD] > 0.0 or settings[JITTER] > 0.0 or settings[DROPOUT] > 0.0:
        return False
    late, later = arena[SENSOR_DELAY * LANES], arena[(SENSOR_DELAY + 1) * LANES]
    others = 0
    for i in range(LANES):
        others += arena[i + SENSOR_DELAY * LANES] != late
        others += arena[i + (SENSOR_DELAY + 1) * LANES] != later
        others += arena[i + (EPISODE + DRAWN_NOISE) * LANES] != 0.0
    return others == 0


def sample_alike(arena: Any, history: Any, clock: Any, settings: Any, who: Any) -> None:
    """What `sample` does for one lane, where all are `alike`: their readings lie side by side in the delay line."""
    h = settings[STEP]
    late = arena[SENSOR_DELAY * LANES]
    later = arena[(SENSOR_DELAY + 1) * LANES] - late
    copy_readings(arena, history, clock, h, 0, late)
    copy_readings(arena, history, clock, h, 1, late + later)
    for i in range(LANES):
        taken = clock[STEPS, i] * h - late
        fresh = who[i] and taken >= arena[i + SAMPLE_TIME * LANES] + 0.5 * settings[PERIOD]
        arena[i + SAMPLE_AGE * LANES] = late if fresh else -1.0
    for i in range(0 if TRUE_SENSOR else LANES):
        x, y = point_at(arena, settings, i, arena[i + SAMPLE_POINT * LANES], arena[i + (SAMPLE_POINT + 1) * LANES])
        arena[i + SAMPLE_POINT * LANES] = x
        arena[i + (SAMPLE_POINT + 1) * LANES] = y


def copy_readings(arena: Any, history: Any, clock: Any, h: float, j: int, late: float) -> None:
    """Enter the reading j of `late` seconds ago, of all lanes."""
    slots = history.shape[0] // (4 * LANES)
    slot = clock[HEAD, 0]
    readings = arena[(SAMPLE_POINT + j) * LANES : (SAMPLE_POINT + j + 1) * LANES]
    if late == 0.0:
        now = history[(4 * slot + j) * LANES : (4 * slot + j + 1) * LANES]
        for i in range(LANES):
            readings[i] = now[i]
        return
    first, last, u = around(slots, slot, late / h)
    a = history[(first + j) * LANES : (first + j + 1) * LANES]
    b = history[(last + j) * LANES : (last + j + 1) * LANES]
    a_rate = history[(first + 2 + j) * LANES : (first + 3 + j) * LANES]
    b_rate = history[(last + 2 + j) * LANES : (last + 3 + j) * LANES]
    for i in range(LANES):
        readings[i] = between(a[i], b[i], a_rate[i], b_rate[i], h, u)[0]


def sample(arena: Any, history: Any, clock: Any, keys: Any, plan: Any, settings: Any, i: int) -> None:
    """Age and position of the newest reading that has arrived at lane i; a negative age if there is none."""
    h = settings[STEP]
    now = clock[STEPS, i] * h
    later = arena[i + (SENSOR_DELAY + 1) * LANES] - arena[i + SENSOR_DELAY * LANES]
    late, place = newest_reading(arena, clock, keys, plan, settings, i, now, arena[i + SAMPLE_TIME * LANES])
    arena[i + SAMPLE_AGE * LANES] = late
    if late < 0.0:
        return
    x, y = sensed_point(arena, history, clock, settings, i, late, late + later)
    if DISTURBED:
        deviation = arena[i + (EPISODE + DRAWN_NOISE) * LANES]
        if deviation > 0.0:
            noise_x = deviation * normal(keys[i], place + 2)
            noise_y = deviation * normal(keys[i], place + 4)
            x += noise_x
            y += noise_y
            if LATE:  # the law sees the same noise until the next reading
                arena[i + NOISE * LANES] = noise_x
                arena[i + (NOISE + 1) * LANES] = noise_y
    arena[i + SAMPLE_POINT * LANES] = x
    arena[i + (SAMPLE_POINT + 1) * LANES] = y


def newest_reading(
    arena: Any, clock: Any, keys: Any, plan: Any, settings: Any, i: int, now: float, before: float
) -> tuple[float, int]:
    """Age of the newest reading that has arrived at lane i [s], negative if there is none to take over.

    A continuous sensor gives one for each control instant. One with a clock of its own gives one for each of its ticks,
    delayed and lost by the tick's own draws, and a tick may arrive after a later one.

    Args:
        arena: of one block.
        clock: of each lane.
        keys: of each lane's episode.
        plan: see `rows`.
        settings: see `rows`.
        i: the lane.
        now: [s].
        before: when the reading that is known was taken [s].

    Returns:
        The age, and the first random number that belongs to the reading.
    """
    delay = arena[i + SENSOR_DELAY * LANES]
    if not DISTURBED:
        return (delay if now - delay >= before + 0.5 * settings[PERIOD] else -1.0), 0
    return disturbed_reading(clock, keys, plan, settings, i, now, before + 0.5 * settings[PERIOD], delay)


def disturbed_reading(
    clock: Any, keys: Any, plan: Any, settings: Any, i: int, now: float, least: float, delay: float
) -> tuple[float, int]:
    """As `newest_reading`, with draws and a clock of the sensor's own.

    Args: as there, and
        least: when a reading must have been taken to be new enough [s].
        delay: without jitter [s].
    """
    if settings[HOLD] == 0.0:
        place = noise_place(clock, plan, i)
        if settings[DROPOUT] > 0.0 and uniform(keys[i], place) < settings[DROPOUT]:
            return -1.0, place
        late = delay
        if settings[JITTER] > 0.0:
            late += settings[JITTER] * uniform(keys[i], place + 1)
        return (late if now - late >= least else -1.0), place
    hold = settings[HOLD]
    first = floor(clock[BEGAN, i] * settings[STEP] / hold) - 2 - floor(delay / hold)
    newest = floor((now - delay) / hold + 1e-9)
    place = 0
    for back in range(int((settings[JITTER] + settings[PERIOD]) / hold) + 2):
        tick = newest - back
        late = now - tick * hold
        if tick * hold < least or tick < first:
            return -1.0, place
        place = FIRST_NOISE + 2 * CHANNELS_OF_NOISE * int(tick - first)
        arrived = delay + settings[JITTER] * uniform(keys[i], place + 1) <= late + 1e-9 * hold
        if arrived and uniform(keys[i], place) >= settings[DROPOUT]:
            return late, place
    return -1.0, place


def noise_place(clock: Any, plan: Any, i: int) -> int:
    """First of the random numbers set aside for the control period that lane i has reached."""
    return FIRST_NOISE + CHANNELS_OF_NOISE * 2 * ((clock[STEPS, i] - clock[BEGAN, i]) // plan[SUBSTEPS])


def sensed_point(
    arena: Any, history: Any, clock: Any, settings: Any, i: int, late: float, later: float
) -> tuple[float, float]:
    """Position that the sensor of lane i measured `late` (its elbow's angle `later`) seconds ago [m]."""
    h = settings[STEP]
    slots = history.shape[0] // (4 * LANES)
    slot = clock[HEAD, 0]
    first, _ = past_reading(history, slots, slot, i, 0, h, late / h)
    second, _ = past_reading(history, slots, slot, i, 1, h, later / h)
    if TRUE_SENSOR:
        return first, second
    return point_at(arena, settings, i, first, second)


def point_at(arena: Any, settings: Any, i: int, theta1: float, theta2: float) -> tuple[float, float]:
    """Where the sensor of lane i is on the rigid arm with these joint angles [m]."""
    one, both = sincos(theta1), sincos(theta1 + theta2)
    distance = arena[i + PLACE_DISTANCE * LANES]
    length_1 = settings[LENGTHS]
    return length_1 * one[1] + distance * both[1], length_1 * one[0] + distance * both[0]


def compare(arena: Any, clock: Any, paths: Any, settings: Any) -> None:
    """Take over the readings that there are: their error from where the reference was, and its change per second."""
    h = settings[STEP]
    searched = 0
    for i in range(LANES):  # on the present side where it was follows from where it is, without a search
        late = arena[i + SAMPLE_AGE * LANES]
        for r in range(2):
            then = arena[i + (REFERENCE + r) * LANES] - late * arena[i + (REFERENCE + 2 + r) * LANES]
            arena[i + (SAMPLE_REFERENCE + r) * LANES] = then
        searched += late > arena[i + SIDE_PASSED * LANES]
    for i in range(LANES if searched > 0 else 0):
        late = arena[i + SAMPLE_AGE * LANES]
        if late > arena[i + SIDE_PASSED * LANES]:
            taken = clock[STEPS, i] * h - late
            there = reference_at(paths, clock[PATH, i], taken, taken + 1e-9 * h, clock[SINCE, i] * h)
            arena[i + SAMPLE_REFERENCE * LANES] = there[0]
            arena[i + (SAMPLE_REFERENCE + 1) * LANES] = there[1]
    for i in range(LANES):
        late, before = arena[i + SAMPLE_AGE * LANES], arena[i + SAMPLE_TIME * LANES]
        fresh = late >= 0.0
        taken = clock[STEPS, i] * h - late
        per_second = 1.0 / (taken - before)
        arena[i + SAMPLE_TIME * LANES] = taken if fresh else before
        for r in range(2):
            point, known = arena[i + (SAMPLE_POINT + r) * LANES], arena[i + (SENSOR_ERROR + r) * LANES]
            error = arena[i + (SAMPLE_REFERENCE + r) * LANES] - point
            rate = arena[i + (SENSOR_ERROR_RATE + r) * LANES]
            arena[i + (SENSOR_ERROR_RATE + r) * LANES] = (error - known) * per_second if fresh else rate
            arena[i + (SENSOR_ERROR + r) * LANES] = error if fresh else known
            arena[i + (SENSED + r) * LANES] = point if fresh else arena[i + (SENSED + r) * LANES]
