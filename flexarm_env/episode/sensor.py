"""Drivers of the sensor on link 2: which reading has arrived, its position, its error from the reference.

`imex` explains lanes, blocks and arenas; `envs.sensors` declares the sensors.
"""

from __future__ import annotations

from numpy import floor

from flexarm_env.codegen.arrays import Arena, Four, LaneRow, Table
from flexarm_env.codegen.declarations import per_lane
from flexarm_env.codegen.elementary import normal, sincos, uniform
from flexarm_env.kernels.delay_line import bracket, hermite, point_at, sensed_point
from flexarm_env.kernels.entries import clock_row, drawn, reading_row, setting, word
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.variants import Block, variant
from flexarm_env.physics.inverse_kinematics import joint_angles_for, joint_rates_for
from flexarm_env.physics.polyline import reference_at

CHANNELS_OF_NOISE = 8  # random numbers of a control period for the sensors, then as many for the encoders
FIRST_NOISE = 64  # random numbers set aside for the start of an episode


def sense(block: Block) -> None:
    """Read the sensor in a block's lanes: latest positions that have arrived, their errors, and the errors' change.

    A reading must be newer than the last one by half a control period, so that the change per second is meaningful.
    """
    arena, active = block.arena, block.active
    if variant.batch and uniform_delay(arena):
        sample_uniform(block)
    else:
        for i in range(variant.lanes):
            arena[row.SAMPLE_AGE, i] = -1.0
            if active[i]:
                sample(block, i)
    update_sensor_error(block)


def uniform_delay(arena: Arena) -> bool:
    """Return whether all lanes of a block have the same sensor delay, and no reading is random."""
    late, later = arena[row.SENSOR_DELAY, 0], arena[row.SENSOR_DELAY + 1, 0]
    others = 0
    for i in range(variant.lanes if variant.disturbed else 0):
        others += arena[row.HOLD, i] + arena[row.JITTER, i] + arena[row.DROPOUT, i] + arena[row.OUTAGE + 1, i] > 0.0
    for i in range(variant.lanes):
        others += arena[row.SENSOR_DELAY, i] != late
        others += arena[row.SENSOR_DELAY + 1, i] != later
        others += arena[row.EPISODE + drawn.NOISE, i] != 0.0
    return others == 0


def sample_uniform(block: Block) -> None:
    """Do for all lanes of a block with a `uniform_delay` what `sample` does for one lane."""
    settings, arena, clock, active = block.settings, block.arena, block.clock, block.active
    h = settings[setting.STEP]
    late = arena[row.SENSOR_DELAY, 0]
    later = arena[row.SENSOR_DELAY + 1, 0] - late
    copy_readings(block, h, 0, late)
    copy_readings(block, h, 1, late + later)
    for i in range(variant.lanes):
        taken = clock[clock_row.STEPS, i] * h - late
        fresh = active[i] and taken >= arena[row.SAMPLE_TIME, i] + 0.5 * settings[setting.PERIOD]
        arena[row.SAMPLE_AGE, i] = late if fresh else -1.0
    if not variant.true_sensor:
        for i in range(variant.lanes):
            x, y = point_at(block, i, arena[row.SAMPLE_POINT, i], arena[row.SAMPLE_POINT + 1, i])
            arena[row.SAMPLE_POINT, i] = x
            arena[row.SAMPLE_POINT + 1, i] = y


def copy_readings(block: Block, h: float, j: int, late: float) -> None:
    """Copy reading j of `late` seconds ago, of all lanes."""
    arena, history, clock = block.arena, block.history, block.clock
    slots = history.shape[0] // variant.slot_rows
    slot = clock[clock_row.HEAD, 0]
    readings: LaneRow = arena[row.SAMPLE_POINT + j]
    if late == 0.0:
        now: LaneRow = history[variant.slot_rows * slot + j]
        for i in range(variant.lanes):
            readings[i] = now[i]
        return
    first, last, u = bracket(slots, slot, late / h)
    a: LaneRow = history[first + j]
    b: LaneRow = history[last + j]
    a_rate: LaneRow = history[first + reading_row.RATE + j]
    b_rate: LaneRow = history[last + reading_row.RATE + j]
    for i in range(variant.lanes):
        readings[i] = hermite(a[i], b[i], a_rate[i], b_rate[i], h, u)[0]


@per_lane
def sample(block: Block, i: int) -> None:
    """Set age and position of the newest reading that has arrived at lane i; the age is negative if there is none."""
    settings, arena, clock, keys = block.settings, block.arena, block.clock, block.keys
    h = settings[setting.STEP]
    now = clock[clock_row.STEPS, i] * h
    later = arena[row.SENSOR_DELAY + 1, i] - arena[row.SENSOR_DELAY, i]
    late, place = latest_reading(block, i, now, arena[row.SAMPLE_TIME, i])
    arena[row.SAMPLE_AGE, i] = late
    if late < 0.0:
        return
    x, y = sensed_point(block, i, late, late + later)
    if variant.disturbed:
        deviation = arena[row.EPISODE + drawn.NOISE, i]
        if deviation > 0.0:
            noise_x = deviation * normal(keys[i], place + 2)
            noise_y = deviation * normal(keys[i], place + 4)
            x += noise_x
            y += noise_y
            if variant.law and variant.law_on_sensor:  # the law sees the same noise until the next reading
                arena[row.NOISE, i] = noise_x
                arena[row.NOISE + 1, i] = noise_y
    arena[row.SAMPLE_POINT, i] = x
    arena[row.SAMPLE_POINT + 1, i] = y


@per_lane
def latest_reading(block: Block, i: int, now: float, before: float) -> tuple[float, int]:
    """Find the newest reading that has arrived at lane i.

    A continuous sensor has one reading for each control instant. A sensor with its own clock has one for each tick,
    whose delay and loss are drawn for the tick, so that a tick may arrive after a later one.

    Args:
        block: the block.
        i: the lane.
        now: present time [s].
        before: time at which the last reading was taken [s].

    Returns:
        Its age [s], negative if there is none, and the index of the first random number of the reading.
    """
    settings, arena = block.settings, block.arena
    delay = arena[row.SENSOR_DELAY, i]
    if not variant.disturbed:
        return (delay if now - delay >= before + 0.5 * settings[setting.PERIOD] else -1.0), 0
    return disturbed_reading(block, i, now, before + 0.5 * settings[setting.PERIOD], delay)


@per_lane
def disturbed_reading(block: Block, i: int, now: float, least: float, delay: float) -> tuple[float, int]:
    """Find what `latest_reading` finds, for a sensor with jitter, lost readings, an outage or its own clock.

    The reading may have been taken at the time `least` [s] at the earliest. `delay` is its delay without jitter [s],
    `now` the present time [s].
    """
    settings, arena, clock, keys = block.settings, block.arena, block.clock, block.keys
    hold, jitter, dropout = arena[row.HOLD, i], arena[row.JITTER, i], arena[row.DROPOUT, i]
    h = settings[setting.STEP]
    begun = clock[clock_row.BEGAN, i] * h + arena[row.OUTAGE, i]
    ended = begun + arena[row.OUTAGE + 1, i]  # of readings that are taken in between
    if hold == 0.0:
        place = noise_place(block, i)
        if dropout > 0.0 and uniform(keys[i], place) < dropout:
            return -1.0, place
        late = delay
        if jitter > 0.0:
            late += jitter * uniform(keys[i], place + 1)
        taken = now - late
        return (late if taken >= least and not begun <= taken + 1e-9 * h < ended else -1.0), place
    first = floor(clock[clock_row.BEGAN, i] * settings[setting.STEP] / hold) - 2 - floor(delay / hold)
    newest = floor((now - delay) / hold + 1e-9)
    place = 0
    for back in range(int((jitter + settings[setting.PERIOD]) / hold) + 2):
        tick = newest - back
        late = now - tick * hold
        if tick * hold < least or tick < first:
            return -1.0, place
        place = FIRST_NOISE + 2 * CHANNELS_OF_NOISE * int(tick - first)
        arrived = delay + jitter * uniform(keys[i], place + 1) <= late + 1e-9 * hold
        if arrived and not begun <= tick * hold + 1e-9 * h < ended and uniform(keys[i], place) >= dropout:
            return late, place
    return -1.0, place


def noise_place(block: Block, i: int) -> int:
    """Return the index of the first random number of lane i's present control period.

    The period has 6 for the reading that arrives (a sensor with its own clock uses those of the tick), 2 that further
    sensors may use (`sense_further`), and 8 for the encoders.
    """
    header, clock = block.header, block.clock
    return FIRST_NOISE + CHANNELS_OF_NOISE * 2 * (
        (clock[clock_row.STEPS, i] - clock[clock_row.BEGAN, i]) // header[word.SUBSTEPS]
    )


def joint_motion(settings: Table, branch: float, reference: Four) -> Four:
    """Return joint angles and rates of the rigid arm whose tip has the reference's position and velocity."""
    x, y, vx, vy = reference
    length_1, length_2 = settings[setting.LENGTHS], settings[setting.LENGTHS + 1]
    theta1, theta2 = joint_angles_for(length_1, length_2, branch, x, y)
    rate_1, rate_2 = joint_rates_for(length_1, length_2, theta1, theta2, vx, vy)
    return theta1, theta2, rate_1, rate_2


def point_on_reference(settings: Table, branch: float, link: int, distance: float, reference: Four) -> Four:
    """Return position and velocity of a link's point on the rigid arm whose tip moves as the reference does."""
    if link == 2 and distance == settings[setting.LENGTHS + 1]:  # the point is the tip
        return reference
    theta1, theta2, rate_1, rate_2 = joint_motion(settings, branch, reference)
    along_1 = distance if link == 1 else settings[setting.LENGTHS]
    along_2 = 0.0 if link == 1 else distance
    one, both = sincos(theta1), sincos(theta1 + theta2)
    rate_12 = rate_1 + rate_2
    return (
        along_1 * one[1] + along_2 * both[1],
        along_1 * one[0] + along_2 * both[0],
        -along_1 * one[0] * rate_1 - along_2 * both[0] * rate_12,
        along_1 * one[1] * rate_1 + along_2 * both[1] * rate_12,
    )


def nominal_age(block: Block, i: int) -> float:
    """Return the age by the declared delay and clock of a reading that arrives at lane i now, if none is lost [s]."""
    settings, arena, clock = block.settings, block.arena, block.clock
    delay, hold = arena[row.NOMINAL_DELAY, i], arena[row.NOMINAL_HOLD, i]
    if not variant.disturbed or hold == 0.0:
        return delay
    now = clock[clock_row.STEPS, i] * settings[setting.STEP]
    return now - floor((now - delay) / hold + 1e-9) * hold


def update_sensor_error(block: Block) -> None:
    """Update the sensor's position, its age, its error from the reference, and the error's change per second.

    A controller knows when a reading arrives, not when it was taken: errors are those of the nominal age. What is
    drawn (delay, jitter, lost readings) is in the true age alone.
    """
    settings, arena, clock, paths = block.settings, block.arena, block.clock, block.paths
    h = settings[setting.STEP]
    searched = 0
    for i in range(variant.lanes):  # within the present side, the earlier reference follows without a search
        late = nominal_age(block, i)
        for r in range(2):
            then = arena[row.REFERENCE + r, i]
            if not variant.racing:  # it compares with the present reference: the speed of an earlier one is not kept
                then -= late * arena[row.REFERENCE + 2 + r, i]
            arena[row.SAMPLE_REFERENCE + r, i] = then
        if not variant.racing:
            searched += late > arena[row.SEGMENT_PASSED, i]
    for i in range(variant.lanes if searched > 0 else 0):
        late = nominal_age(block, i)
        if late > arena[row.SEGMENT_PASSED, i]:
            taken = clock[clock_row.STEPS, i] * h - late
            there = reference_at(
                paths, clock[clock_row.PATH, i], taken, taken + 1e-9 * h, clock[clock_row.SINCE, i] * h
            )
            arena[row.SAMPLE_REFERENCE, i] = there[0]
            arena[row.SAMPLE_REFERENCE + 1, i] = there[1]
    for i in range(variant.lanes):
        now, late, before = clock[clock_row.STEPS, i] * h, arena[row.SAMPLE_AGE, i], arena[row.SAMPLE_TIME, i]
        fresh = late >= 0.0
        arena[row.SAMPLE_TIME, i] = now - late if fresh else before
        arena[row.READING_AGE, i] = late if fresh else now - before
        nominal, earlier = now - nominal_age(block, i), arena[row.NOMINAL_TIME, i]
        arena[row.NOMINAL_TIME, i] = nominal if fresh else earlier
        apart = nominal - earlier  # 0 if two ticks of the sensor's clock arrive where one was due
        per_second = 1.0 / (apart if apart > 0.499 * settings[setting.PERIOD] else arena[row.NOMINAL_HOLD, i])
        for r in range(2):
            point, known = arena[row.SAMPLE_POINT + r, i], arena[row.SENSOR_ERROR + r, i]
            error = arena[row.SAMPLE_REFERENCE + r, i] - point
            rate = arena[row.SENSOR_ERROR_RATE + r, i]
            arena[row.SENSOR_ERROR_RATE + r, i] = (error - known) * per_second if fresh else rate
            arena[row.SENSOR_ERROR + r, i] = error if fresh else known
            arena[row.LINK_SENSOR + r, i] = point if fresh else arena[row.LINK_SENSOR + r, i]
