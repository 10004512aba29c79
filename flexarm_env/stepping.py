"""Drivers of the closed loop's kernels: loops over lanes, stages, steps and blocks.

`kernels` assembles these functions with the recorded physics into one module per variant and compiles that; here
they are plain Python for reading, checking and testing. The names in capitals are constants of the assembled
module (`layout`); those below belong to one mode and one lane, and stand here so that the file is complete.

A *block* holds LANES environments. Its *arena* is one flat array of rows of LANES numbers, ``arena[i + row *
LANES]`` for lane i: constant row distance and indices that cannot be negative let the compiler work on several
lanes at once.
"""

from __future__ import annotations

from math import floor
from typing import Any

from flexarm_env.reward import reward_terms

LANES = 1
SIZE = 4  # internal coordinates
STAGES = 4
Y = V = Y_STAGE = V_STAGE = V_SLOTS = MECHANICAL = MECHANICAL_SLOTS = FEEDBACK = FEEDBACK_SLOTS = OFFSET = 0
WEIGHT = RATE_OFFSET = RATE_WEIGHT = COMMAND_1 = COMMAND_2 = DELAY = COMMAND_DELAY = RATE_LATE = READING = 0
TAU = REFERENCE = STATE = LIMITS = TRUE_TIP = REWARD_TERMS = STATUS = TORQUE = 0

# ARS(4,4,3) of Ascher, Ruuth & Spiteri (1997), third order: explicit coefficients for the arm, singly diagonally
# implicit and stiffly accurate ones (gamma = 1/2, L-stable) for the law. The last stage is the step's result.
NODES = (0.5, 2.0 / 3.0, 0.5, 1.0)
GAMMA = 0.5
EXPLICIT = (
    (0.5, 0.0, 0.0, 0.0),
    (11.0 / 18.0, 1.0 / 18.0, 0.0, 0.0),
    (5.0 / 6.0, -5.0 / 6.0, 0.5, 0.0),
    (0.25, 1.75, 0.75, -1.75),
)
IMPLICIT = (
    (0.0, 0.0, 0.0, 0.0),
    (0.0, 1.0 / 6.0, 0.0, 0.0),
    (0.0, -0.5, 0.5, 0.0),
    (0.0, 1.5, -1.5, 0.5),
)


def law_kernel(arena: Any, h: float, ahead: float, explicit: Any, implicit: Any) -> None:
    """One stage of the closed loop on every lane (recorded): combine earlier stages, then `closed_loop.law_stage`.

    Args:
        arena: of one block; results in Y_STAGE, V_STAGE, MECHANICAL, FEEDBACK, TAU.
        h: step [s].
        ahead: time of the stage after the step's start [s].
        explicit: coefficients of the stages before, explicit part.
        implicit: the same, implicit part.
    """
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def reading_kernel(arena: Any) -> None:
    """What the sensor would measure now, without delay, on every lane (recorded)."""
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def outputs_kernel(arena: Any) -> None:
    """Sensed position and tips on every lane (recorded)."""
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def reference_at(path: Any, time: float, side: float) -> tuple[float, float, float, float]:
    """Reference position and velocity on a closed polyline.

    Args:
        path: way-points (time [s], x, y [m]), the last one closing the lap. Shape (n, 3).
        time: where to evaluate [s]; before 0 the reference rests at the start.
        side: picks the side where `time` is at a corner: a time on it [s].

    Returns:
        x, y [m], x', y' [m/s].
    """
    if side < 0.0:
        return path[0, 1], path[0, 2], 0.0, 0.0
    last = path.shape[0] - 1
    before = floor(side / path[last, 0]) * path[last, 0]  # laps done
    k = 1
    while k < last and side - before >= path[k, 0]:
        k += 1
    per_second = 1.0 / (path[k, 0] - path[k - 1, 0])
    vx = (path[k, 1] - path[k - 1, 1]) * per_second
    vy = (path[k, 2] - path[k - 1, 2]) * per_second
    since = time - before - path[k - 1, 0]
    return path[k - 1, 1] + vx * since, path[k - 1, 2] + vy * since, vx, vy


def prepare_commands(arena: Any, count: Any, path: Any, h: float) -> None:
    """Write each joint's command for the step at hand: position at its start, and velocity.

    Within a step the reference runs along its chord. Where a corner falls inside, the velocity is then its mean over
    the step, so that the jump acts on the arm at the right time, to second order in the step.

    Args:
        arena: of one block.
        count: steps since the start of each lane. Shape (LANES,).
        path: see `reference_at`.
        h: step [s].
    """
    for i in range(LANES):
        late_1 = arena[i + COMMAND_DELAY * LANES]
        late_2 = arena[i + (COMMAND_DELAY + 1) * LANES]
        command_1 = chord_at(path, count[i] * h - late_1, h)
        command_2 = command_1
        if late_2 != late_1:
            command_2 = chord_at(path, count[i] * h - late_2, h)
        for r in range(4):
            arena[i + (COMMAND_1 + r) * LANES] = command_1[r]
            arena[i + (COMMAND_2 + r) * LANES] = command_2[r]


def chord_at(path: Any, time: float, h: float) -> tuple[float, float, float, float]:
    """Position [m] at a time [s], and mean velocity [m/s] over the step h [s] that begins there."""
    start = reference_at(path, time, time)
    end = reference_at(path, time + h, time + h)
    return start[0], start[1], (end[0] - start[0]) / h, (end[1] - start[1]) / h


def prepare_readings(arena: Any, history: Any, count: Any, h: float, node: float) -> None:
    """Write the late readings for a stage at t + node h.

    Args:
        arena: of one block.
        history: readings at past steps, a ring. Shape (slots, 4, LANES) flat: two readings, two rates.
        count: steps since the start of each lane. Shape (LANES,).
        h: step [s].
        node: of the stage, 0 to 1.
    """
    slots = history.shape[0] // (4 * LANES)
    for i in range(LANES):
        slot = count[i] % slots
        for j in range(2):
            prepare_reading(arena, history, slots, slot, i, j, h, node)


def prepare_reading(arena: Any, history: Any, slots: int, slot: int, i: int, j: int, h: float, node: float) -> None:
    """Write offset and weight of reading j of lane i at t + node h (see `closed_loop.Law`).

    Readings at past steps are interpolated by cubic Hermite polynomials, whose error is of fourth order. A delay
    shorter than node h falls into the step at hand: the reading is then a parabola through the one at t, with its
    rate, and the stage's own, so that it tends to the undelayed one as the delay vanishes.
    """
    position = node - arena[i + (DELAY + j) * LANES] / h  # in steps from t
    here = slot * 4 * LANES
    offset = 0.0
    weight = 1.0
    rate_offset = 0.0
    rate_weight = 1.0
    if position > 0.0:
        u = position / node
        value = history[i + here + j * LANES]
        rate = history[i + here + (2 + j) * LANES]
        weight = u * u
        offset = value * (1.0 - u * u) + rate * h * (position - position * u)
        rate_weight = u
        rate_offset = rate * (1.0 - u)
    elif node > 0.0 or position < 0.0:
        whole = int(-position)  # steps back, rounded towards t
        u = 1.0 - (-position - whole)  # within the interval that ends there
        last = slot - whole  # the ring is longer than any delay, so one turn back is enough
        first = last - 1
        end = (last if last >= 0 else last + slots) * 4 * LANES
        start = (first if first >= 0 else first + slots) * 4 * LANES
        a = history[i + start + j * LANES]
        b = history[i + end + j * LANES]
        a_rate = h * history[i + start + (2 + j) * LANES]
        b_rate = h * history[i + end + (2 + j) * LANES]
        difference = b - a
        curve = 3.0 * difference - 2.0 * a_rate - b_rate
        twist = a_rate + b_rate - 2.0 * difference
        offset = a + u * (a_rate + u * (curve + u * twist))
        rate_offset = (a_rate + u * (2.0 * curve + u * 3.0 * twist)) / h
        weight = 0.0
        rate_weight = 0.0
    arena[i + (OFFSET + j) * LANES] = offset
    arena[i + (WEIGHT + j) * LANES] = weight
    late = arena[i + RATE_LATE * LANES] > 0.0
    arena[i + (RATE_OFFSET + j) * LANES] = rate_offset if late else 0.0
    arena[i + (RATE_WEIGHT + j) * LANES] = rate_weight if late else 1.0


def store_reading(arena: Any, history: Any, count: Any) -> None:
    """Enter the current readings into the delay line."""
    reading_kernel(arena)
    slots = history.shape[0] // (4 * LANES)
    for i in range(LANES):
        here = (count[i] % slots) * 4 * LANES
        for r in range(4):
            history[i + here + r * LANES] = arena[i + (READING + r) * LANES]


def evaluate_law(arena: Any, history: Any, count: Any, path: Any, h: float) -> None:
    """The law's torque at the present instant with the present gain; mechanical acceleration as well."""
    prepare_commands(arena, count, path, h)
    prepare_readings(arena, history, count, h, 0.0)
    law_kernel(arena, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    for r in range(2):
        for i in range(LANES):
            arena[i + (TORQUE + r) * LANES] = arena[i + (TAU + r) * LANES]


def start(arena: Any, history: Any, count: Any, path: Any, h: float) -> None:
    """Complete every lane of a block from its state."""
    for row in range((STAGES + 1) * SIZE):  # what an earlier episode left, at worst not finite
        for i in range(LANES):
            arena[i + (V_SLOTS + row) * LANES] = 0.0
            arena[i + (MECHANICAL_SLOTS + row) * LANES] = 0.0
            arena[i + (FEEDBACK_SLOTS + row) * LANES] = 0.0
    evaluate_law(arena, history, count, path, h)
    store_stage(arena, 0)


def store_stage(arena: Any, slot: int) -> None:
    """Keep what the law's kernel found for the stages to come."""
    for r in range(SIZE):
        for i in range(LANES):
            row = slot * SIZE + r
            arena[i + (V_SLOTS + row) * LANES] = arena[i + (V_STAGE + r) * LANES]
            arena[i + (MECHANICAL_SLOTS + row) * LANES] = arena[i + (MECHANICAL + r) * LANES]
            arena[i + (FEEDBACK_SLOTS + row) * LANES] = arena[i + (FEEDBACK + r) * LANES]


def loop_step(arena: Any, history: Any, count: Any, path: Any, h: float) -> None:
    """One step of the closed loop on every lane of a block."""
    prepare_commands(arena, count, path, h)
    for stage in range(STAGES):
        prepare_readings(arena, history, count, h, NODES[stage])
        law_kernel(arena, h, h * NODES[stage], EXPLICIT[stage], IMPLICIT[stage])
        store_stage(arena, stage + 1)
    for r in range(SIZE):
        for i in range(LANES):
            arena[i + (Y + r) * LANES] = arena[i + (Y_STAGE + r) * LANES]
            arena[i + (V + r) * LANES] = arena[i + (V_STAGE + r) * LANES]
    store_stage(arena, 0)  # the last stage is the step's end, where the next step starts
    for i in range(LANES):
        count[i] += 1
    store_reading(arena, history, count)


def state_status(arena: Any, i: int) -> float:
    """0 for a valid state of lane i; -1 if it is not finite; n if its entry n - 1 is beyond its limit."""
    status = 0.0
    for r in range(2 * SIZE):
        value = arena[i + (STATE + r) * LANES]
        if value - value != 0.0:
            return -1.0
        if status == 0.0 and abs(value) > arena[i + (LIMITS + r) * LANES]:
            status = r + 1.0
    return status


def write_outputs(arena: Any, history: Any, count: Any, path: Any, h: float) -> None:
    """Observation, state, tips, reward and status of every lane of a block at the present instant."""
    prepare_readings(arena, history, count, h, 0.0)
    for i in range(LANES):
        # a billionth of a step ahead: at a corner the side that begins there, whatever the rounding
        reference = reference_at(path, count[i] * h, (count[i] + 1e-9) * h)
        for r in range(4):
            arena[i + (REFERENCE + r) * LANES] = reference[r]
    outputs_kernel(arena)
    for i in range(LANES):
        terms = reward_terms(
            arena[i + TRUE_TIP * LANES],
            arena[i + (TRUE_TIP + 1) * LANES],
            arena[i + REFERENCE * LANES],
            arena[i + (REFERENCE + 1) * LANES],
        )
        arena[i + REWARD_TERMS * LANES] = terms[0]
        arena[i + (REWARD_TERMS + 1) * LANES] = terms[1]
        arena[i + STATUS * LANES] = state_status(arena, i)


def run_loop(arenas: Any, histories: Any, counts: Any, path: Any, h: float, steps: int, initialise: bool) -> None:
    """Advance all blocks by a control period, or complete them after a reset.

    Args:
        arenas: Shape (blocks, rows * LANES).
        histories: Shape (blocks, slots * 4 * LANES).
        counts: Shape (blocks, LANES).
        path: see `reference_at`.
        h: step [s].
        steps: how many; 0 after a reset.
        initialise: complete the states first (after a reset).
    """
    for block in range(arenas.shape[0]):
        arena = arenas[block]
        history = histories[block]
        count = counts[block]
        if initialise:
            start(arena, history, count, path, h)
        else:
            evaluate_law(arena, history, count, path, h)
        for _ in range(steps):
            loop_step(arena, history, count, path, h)
        write_outputs(arena, history, count, path, h)
