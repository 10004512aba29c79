"""Drivers of the delay line: readings at past steps, a ring of slots for each block (`imex` explains blocks and lanes).

The law reads it at its stages (`prepare_readings`), the sensor at control instants (`sensed_point`).

A slot has `Variant.slot_rows` rows: of each sensor of a position two readings and their rates (`entries.ReadingRow`),
then the numbers that other sensors read.
"""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena, Clock, History, Words
from flexarm_env.codegen.declarations import per_lane
from flexarm_env.codegen.elementary import sincos
from flexarm_env.kernels.entries import READING_ROWS, clock_row, reading_row, setting, word
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.recorded import further_reading_kernel, reading_kernel
from flexarm_env.kernels.variants import Block, variant


def slot_after(clock: Clock, history: History, steps: int) -> int:
    """Return the slot of a block's delay line that will be the newest one so many integration steps from now."""
    return (clock[clock_row.HEAD, 0] + steps) % (history.shape[0] // variant.slot_rows)


def count_steps(clock: Clock, history: History, steps: int) -> None:
    """Count integration steps of every lane of a block, and move on in its delay line."""
    head = slot_after(clock, history, steps)
    for i in range(variant.lanes):
        clock[clock_row.STEPS, i] += steps
        clock[clock_row.HEAD, i] = head


def store_reading(arena: Arena, history: History, slot: int) -> None:
    """Enter the current readings of all sensors into a slot of the delay line."""
    reading_kernel(arena, history[slot * variant.slot_rows : (slot + 1) * variant.slot_rows])
    if variant.further_readings:
        further = slot * variant.slot_rows + READING_ROWS
        further_reading_kernel(arena, history[further : (slot + 1) * variant.slot_rows])


def is_kept(header: Words, done: int) -> bool:
    """Whether `Header.KEPT_READINGS` asks for the reading after so many steps of a period, or before it if negative."""
    return bool((header[word.KEPT_READINGS] >> (done % header[word.SUBSTEPS] & 63)) & 1)


def fill_history(block: Block, i: int) -> None:
    """Fill the delay line of lane i with its newest readings; before a start at rest nothing moves."""
    header, history, clock = block.header, block.history, block.clock
    slots = history.shape[0] // variant.slot_rows
    newest = clock[clock_row.HEAD, 0]
    rated = READING_ROWS * (1 + variant.further_points)
    for back in range(1, slots):
        if is_kept(header, -back):
            slot = (newest - back) % slots
            for r in range(variant.slot_rows):
                moves = r < rated and r % READING_ROWS >= reading_row.RATE
                history[variant.slot_rows * slot + r, i] = 0.0 if moves else history[variant.slot_rows * newest + r, i]


@per_lane
def sensed_point(block: Block, i: int, late: float, later: float) -> tuple[float, float]:
    """Return the position that the sensor of lane i measured `late` (its elbow's angle `later`) seconds ago [m]."""
    settings, history, clock = block.settings, block.history, block.clock
    h = settings[setting.STEP]
    slots = history.shape[0] // variant.slot_rows
    slot = clock[clock_row.HEAD, 0]
    first, _ = delayed_reading(history, slots, slot, i, 0, h, late / h)
    second, _ = delayed_reading(history, slots, slot, i, 1, h, later / h)
    if variant.true_sensor:
        return first, second
    return point_at(block, i, first, second)


@per_lane
def point_at(block: Block, i: int, theta1: float, theta2: float) -> tuple[float, float]:
    """Return the position of lane i's sensor on the rigid arm with these joint angles [m]."""
    settings, arena = block.settings, block.arena
    one, both = sincos(theta1), sincos(theta1 + theta2)
    distance = arena[row.SENSOR_POINT_DISTANCE, i]
    length_1 = settings[setting.LENGTHS]
    return length_1 * one[1] + distance * both[1], length_1 * one[0] + distance * both[0]


@per_lane
def delayed_reading(
    history: History, slots: int, slot: int, i: int, j: int, h: float, back: float
) -> tuple[float, float]:
    """Return a reading of lane i and its rate, `back` steps before the newest slot's; see `prepare_reading`.

    Args:
        history: readings at past steps.
        slots: of the delay line.
        slot: the newest one.
        i: the lane.
        j: row of the reading in a slot.
        h: step [s].
        back: the moment, in steps before the newest one.
    """
    if back == 0.0:
        return history[variant.slot_rows * slot + j, i], history[variant.slot_rows * slot + reading_row.RATE + j, i]
    first, last, u = bracket(slots, slot, back)
    return hermite(
        history[first + j, i],
        history[last + j, i],
        history[first + reading_row.RATE + j, i],
        history[last + reading_row.RATE + j, i],
        h,
        u,
    )


@per_lane
def delayed_number(history: History, slots: int, slot: int, i: int, j: int, back: float) -> float:
    """Return a number of lane i that is kept without its rate, linearly between two steps; see `delayed_reading`."""
    if back == 0.0:
        return history[variant.slot_rows * slot + j, i]
    first, last, u = bracket(slots, slot, back)
    return history[first + j, i] + u * (history[last + j, i] - history[first + j, i])


@per_lane
def bracket(slots: int, slot: int, back: float) -> tuple[int, int, float]:
    """Return the rows at which the readings before and after a moment begin, and the share of the step between them.

    Args:
        slots: of the delay line.
        slot: the newest one.
        back: the moment, in steps before the newest one.
    """
    whole = int(back)  # rounded towards the present
    last = slot - whole  # the ring is longer than any delay, so one turn back is enough
    first = last - 1
    first, last = (first if first >= 0 else first + slots), (last if last >= 0 else last + slots)
    return variant.slot_rows * first, variant.slot_rows * last, 1.0 - (back - whole)


@per_lane
def hermite(a: float, b: float, a_rate: float, b_rate: float, h: float, u: float) -> tuple[float, float]:
    """Return value and rate a share u of a step h after a, by the cubic with these values and rates at its ends."""
    a_rise, b_rise = h * a_rate, h * b_rate
    difference = b - a
    curve = 3.0 * difference - 2.0 * a_rise - b_rise
    twist = a_rise + b_rise - 2.0 * difference
    return a + u * (a_rise + u * (curve + u * twist)), (a_rise + u * (2.0 * curve + u * 3.0 * twist)) / h


def prepare_readings(block: Block, h: float, node: float) -> None:
    """Write the late readings for a stage at t + node h.

    Args:
        block: the block.
        h: step [s].
        node: of the stage, 0 to 1.
    """
    arena, history, clock = block.arena, block.history, block.clock
    slots = history.shape[0] // variant.slot_rows
    slot = clock[clock_row.HEAD, 0]
    if variant.law_on_sensor:
        for i in range(variant.lanes):
            for j in range(2):
                prepare_reading(arena, history, slots, slot, i, j, h, node)


def prepare_reading(
    arena: Arena, history: History, slots: int, slot: int, i: int, j: int, h: float, node: float
) -> None:
    """Write offset and weight of reading j of lane i at t + node h (see `jacobian_transpose.Law`).

    Readings at past steps are interpolated by cubic Hermite polynomials, whose error is of fourth order. A delay
    shorter than node h falls into the step at hand: the reading is then a parabola through the one at t, with its
    rate, and the stage's own, so that it tends to the undelayed one as the delay vanishes.
    """
    position = node - arena[row.DELAY + j, i] / h  # in steps from t
    offset = 0.0
    weight = 1.0
    rate_offset = 0.0
    rate_weight = 1.0
    if position > 0.0:
        here = slot * variant.slot_rows
        u = position / node
        value = history[here + j, i]
        rate = history[here + reading_row.RATE + j, i]
        weight = u * u
        offset = value * (1.0 - u * u) + rate * h * (position - position * u)
        rate_weight = u
        rate_offset = rate * (1.0 - u)
    elif node > 0.0 or position < 0.0:
        offset, rate_offset = delayed_reading(history, slots, slot, i, j, h, -position)
        weight = 0.0
        rate_weight = 0.0
    arena[row.OFFSET + j, i] = offset
    arena[row.WEIGHT + j, i] = weight
    late = arena[row.RATE_LATE, i] > 0.0
    arena[row.RATE_OFFSET + j, i] = rate_offset if late else 0.0
    arena[row.RATE_WEIGHT + j, i] = rate_weight if late else 1.0
