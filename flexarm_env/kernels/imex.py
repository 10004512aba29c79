"""Drivers of the closed loop's kernels: loops over lanes, stages, steps and blocks.

`kernels` assembles these functions with the recorded physics into one module per variant and compiles that; here
they are plain Python for reading, checking and testing. The names in capitals are constants of the assembled
module (`layout`); those below belong to one mode and one lane, and stand here so that the file is complete.

A *block* holds LANES environments. Its *arena* is one flat array of rows of LANES numbers, ``arena[i + row *
LANES]`` for lane i: constant row distance and indices that cannot be negative let the compiler work on several
lanes at once.
"""

from __future__ import annotations

from typing import Any

from flexarm_env.kernels.path_cache import (
    AHEAD,
    SIDE_BEGIN,
    SIDE_END,
    SIDE_LAP,
    chord_at,
    forget_side,
    note_side,
    on_side,
    reference_at,
)

LANES = 1
SIZE = 4  # internal coordinates
STAGES = 4
Y = V = Y_STAGE = V_STAGE = V_SLOTS = MECHANICAL = MECHANICAL_SLOTS = FEEDBACK = FEEDBACK_SLOTS = OFFSET = 0
WEIGHT = RATE_OFFSET = RATE_WEIGHT = COMMAND_1 = COMMAND_2 = COMMAND_SIDE = COMMAND_DELAY = 0
DELAY = RATE_LATE = 0
# What a lane's clock counts and points to: integration steps of path time, its path, the step before which the
# reference rests, the step at which the episode began, and the delay line's newest slot, the same for a whole block.
STEPS, PATH, SINCE, BEGAN, HEAD = 0, 1, 2, 3, 4
CLOCK = 5
LATE = True
TAU = REFERENCE = STATE = LIMITS = STATUS = TORQUE = 0

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


def reading_kernel(arena: Any, readings: Any) -> None:
    """What the sensor would measure now, without delay, on every lane: two readings, two rates (recorded)."""
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def outputs_kernel(arena: Any) -> None:
    """Sensed position and tips on every lane (recorded)."""
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def prepare_commands(arena: Any, clock: Any, paths: Any, h: float) -> None:
    """Write each joint's command for the step at hand: position at its start, and velocity.

    Within a step the reference runs along its chord. Where a corner falls inside, the velocity is then its mean over
    the step, so that the jump acts on the arm at the right time, to second order in the step.

    Args:
        arena: of one block.
        clock: of each lane, see STEPS. Shape (CLOCK, LANES).
        paths: of all lanes, see `reference_at`. Shape (paths, n, 5).
        h: step [s].
    """
    others = 0
    for i in range(LANES):
        time = clock[STEPS, i] * h - arena[i + COMMAND_DELAY * LANES]
        for r in range(2):
            here, there = on_side(arena, COMMAND_SIDE, i, r, time), on_side(arena, COMMAND_SIDE, i, r, time + h)
            velocity = (there - here) / h
            for joint in (COMMAND_1, COMMAND_2):
                arena[i + (joint + r) * LANES] = here
                arena[i + (joint + 2 + r) * LANES] = velocity
        others += not chord_known(arena, clock, i, time, h)
    for i in range(LANES if others > 0 else 0):
        p, now, since = clock[PATH, i], clock[STEPS, i] * h, clock[SINCE, i] * h
        late_1, late_2 = arena[i + COMMAND_DELAY * LANES], arena[i + (COMMAND_DELAY + 1) * LANES]
        if not chord_known(arena, clock, i, now - late_1, h):
            note_side(arena, COMMAND_SIDE, paths, p, now - late_1 + h, i)  # where the next step begins
            command_1 = chord_at(paths, p, now - late_1, h, since)
            command_2 = command_1
            if late_2 != late_1:
                command_2 = chord_at(paths, p, now - late_2, h, since)
            for r in range(4):
                arena[i + (COMMAND_1 + r) * LANES] = command_1[r]
                arena[i + (COMMAND_2 + r) * LANES] = command_2[r]


def chord_known(arena: Any, clock: Any, i: int, time: float, h: float) -> bool:
    """Whether lane i's commands run along the noted side in the whole step that begins at a time [s].

    One side is noted for both joints: commands that are late by different times are searched for in each step.
    """
    within = time - arena[i + (COMMAND_SIDE + SIDE_LAP) * LANES]
    begun = (within >= arena[i + (COMMAND_SIDE + SIDE_BEGIN) * LANES]) & (time >= clock[SINCE, i] * h)
    together = arena[i + COMMAND_DELAY * LANES] == arena[i + (COMMAND_DELAY + 1) * LANES]
    return begun & together & (within + h < arena[i + (COMMAND_SIDE + SIDE_END) * LANES])


def prepare_readings(arena: Any, history: Any, clock: Any, h: float, node: float) -> None:
    """Write the late readings for a stage at t + node h.

    Args:
        arena: of one block.
        history: readings at past steps, a ring. Shape (slots, 4, LANES) flat: two readings, two rates.
        clock: of each lane, see STEPS. Shape (CLOCK, LANES).
        h: step [s].
        node: of the stage, 0 to 1.
    """
    slots = history.shape[0] // (4 * LANES)
    slot = clock[HEAD, 0]
    for i in range(LANES if LATE else 0):
        for j in range(2):
            prepare_reading(arena, history, slots, slot, i, j, h, node)


def past_reading(history: Any, slots: int, slot: int, i: int, j: int, h: float, back: float) -> tuple[float, float]:
    """Reading j of lane i and its rate, `back` steps before the slot of the present one; see `prepare_reading`."""
    if back == 0.0:
        return history[i + (4 * slot + j) * LANES], history[i + (4 * slot + 2 + j) * LANES]
    first, last, u = around(slots, slot, back)
    return between(
        history[i + (first + j) * LANES],
        history[i + (last + j) * LANES],
        history[i + (first + 2 + j) * LANES],
        history[i + (last + 2 + j) * LANES],
        h,
        u,
    )


def around(slots: int, slot: int, back: float) -> tuple[int, int, float]:
    """Rows of the delay line at which the readings before and after a moment begin, and where it lies between.

    Args:
        slots: of the delay line.
        slot: the newest one.
        back: the moment, in steps before the newest one.
    """
    whole = int(back)  # rounded towards the present
    last = slot - whole  # the ring is longer than any delay, so one turn back is enough
    first = last - 1
    first, last = (first if first >= 0 else first + slots), (last if last >= 0 else last + slots)
    return 4 * first, 4 * last, 1.0 - (back - whole)


def between(a: float, b: float, a_rate: float, b_rate: float, h: float, u: float) -> tuple[float, float]:
    """Value and rate a share u of a step h after a, by the cubic with these values and rates at its ends."""
    a_rise, b_rise = h * a_rate, h * b_rate
    difference = b - a
    curve = 3.0 * difference - 2.0 * a_rise - b_rise
    twist = a_rise + b_rise - 2.0 * difference
    return a + u * (a_rise + u * (curve + u * twist)), (a_rise + u * (2.0 * curve + u * 3.0 * twist)) / h


def prepare_reading(arena: Any, history: Any, slots: int, slot: int, i: int, j: int, h: float, node: float) -> None:
    """Write offset and weight of reading j of lane i at t + node h (see `closed_loop.Law`).

    Readings at past steps are interpolated by cubic Hermite polynomials, whose error is of fourth order. A delay
    shorter than node h falls into the step at hand: the reading is then a parabola through the one at t, with its
    rate, and the stage's own, so that it tends to the undelayed one as the delay vanishes.
    """
    position = node - arena[i + (DELAY + j) * LANES] / h  # in steps from t
    offset = 0.0
    weight = 1.0
    rate_offset = 0.0
    rate_weight = 1.0
    if position > 0.0:
        here = slot * 4 * LANES
        u = position / node
        value = history[i + here + j * LANES]
        rate = history[i + here + (2 + j) * LANES]
        weight = u * u
        offset = value * (1.0 - u * u) + rate * h * (position - position * u)
        rate_weight = u
        rate_offset = rate * (1.0 - u)
    elif node > 0.0 or position < 0.0:
        offset, rate_offset = past_reading(history, slots, slot, i, j, h, -position)
        weight = 0.0
        rate_weight = 0.0
    arena[i + (OFFSET + j) * LANES] = offset
    arena[i + (WEIGHT + j) * LANES] = weight
    late = arena[i + RATE_LATE * LANES] > 0.0
    arena[i + (RATE_OFFSET + j) * LANES] = rate_offset if late else 0.0
    arena[i + (RATE_WEIGHT + j) * LANES] = rate_weight if late else 1.0


def slot_after(clock: Any, history: Any, steps: int) -> int:
    """Slot of a block's delay line that so many integration steps from now on will be the newest one."""
    return (clock[HEAD, 0] + steps) % (history.shape[0] // (4 * LANES))


def count_steps(clock: Any, history: Any, steps: int) -> None:
    """Count integration steps of every lane of a block, and move on in its delay line."""
    head = slot_after(clock, history, steps)
    for i in range(LANES):
        clock[STEPS, i] += steps
        clock[HEAD, i] = head


def store_reading(arena: Any, history: Any, slot: int) -> None:
    """Enter the current readings into a slot of the delay line."""
    reading_kernel(arena, history[slot * 4 * LANES : (slot + 1) * 4 * LANES])


def evaluate_law(arena: Any, history: Any, clock: Any, paths: Any, h: float) -> None:
    """The law's torque at the present instant with the present gain; mechanical acceleration as well."""
    prepare_commands(arena, clock, paths, h)
    prepare_readings(arena, history, clock, h, 0.0)
    law_kernel(arena, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    for r in range(2):
        for i in range(LANES):
            arena[i + (TORQUE + r) * LANES] = arena[i + (TAU + r) * LANES]


def start(arena: Any, history: Any, clock: Any, paths: Any, h: float) -> None:
    """Complete every lane of a block from its state."""
    for i in range(LANES):
        forget_side(arena, COMMAND_SIDE, i)
    for row in range(STAGES * SIZE):  # what an earlier episode left, at worst not finite
        for i in range(LANES):
            arena[i + (V_SLOTS + row) * LANES] = 0.0
            arena[i + (MECHANICAL_SLOTS + row) * LANES] = 0.0
            arena[i + (FEEDBACK_SLOTS + row) * LANES] = 0.0
    evaluate_law(arena, history, clock, paths, h)
    store_stage(arena, 0)


def store_stage(arena: Any, slot: int) -> None:
    """Keep what the law's kernel found for the stages to come."""
    for r in range(SIZE):
        for i in range(LANES):
            row = slot * SIZE + r
            arena[i + (V_SLOTS + row) * LANES] = arena[i + (V_STAGE + r) * LANES]
            arena[i + (MECHANICAL_SLOTS + row) * LANES] = arena[i + (MECHANICAL + r) * LANES]
            arena[i + (FEEDBACK_SLOTS + row) * LANES] = arena[i + (FEEDBACK + r) * LANES]


def loop_step(arena: Any, history: Any, clock: Any, paths: Any, h: float) -> None:
    """One step of the closed loop on every lane of a block."""
    prepare_commands(arena, clock, paths, h)
    for stage in range(STAGES):
        prepare_readings(arena, history, clock, h, NODES[stage])
        law_kernel(arena, h, h * NODES[stage], EXPLICIT[stage], IMPLICIT[stage])
        if stage + 1 < STAGES:
            store_stage(arena, stage + 1)
    for r in range(SIZE):
        for i in range(LANES):
            arena[i + (Y + r) * LANES] = arena[i + (Y_STAGE + r) * LANES]
            arena[i + (V + r) * LANES] = arena[i + (V_STAGE + r) * LANES]
    store_stage(arena, 0)  # the last stage is the step's end, where the next step starts
    count_steps(clock, history, 1)
    store_reading(arena, history, clock[HEAD, 0])


def state_status(arena: Any) -> None:
    """Status of every lane: 0 for a valid state; -1 if it is not finite; n if its entry n - 1 is beyond its limit."""
    for i in range(LANES):
        status = 0.0
        for r in range(2 * SIZE - 1, -1, -1):
            beyond = not abs(arena[i + (STATE + r) * LANES]) <= arena[i + (LIMITS + r) * LANES]
            status = r + 1.0 if beyond else status
        for r in range(2 * SIZE):
            value = arena[i + (STATE + r) * LANES]
            status = status if value - value == 0.0 else -1.0
        arena[i + STATUS * LANES] = status


def failures(size: int) -> dict[float, str | None]:
    """What a state's status means (`state_status`): why it is not valid; 0 is that of a valid one.

    Args:
        size: number of internal coordinates.
    """
    entries = ("angle", "angle", *["deflection"] * (size - 2), *["rate"] * size)
    return {0.0: None, -1.0: "diverged"} | {1.0 + n: reason for n, reason in enumerate(entries)}


def write_outputs(arena: Any, history: Any, clock: Any, paths: Any, h: float) -> None:
    """Observation, state, tips, reward and status of every lane of a block at the present instant."""
    prepare_readings(arena, history, clock, h, 0.0)
    for i in range(LANES):
        steps = clock[STEPS, i]
        reference = reference_at(paths, clock[PATH, i], steps * h, (steps + AHEAD) * h, clock[SINCE, i] * h)
        for r in range(4):
            arena[i + (REFERENCE + r) * LANES] = reference[r]
    outputs_kernel(arena)
    state_status(arena)


def run_loop(arenas: Any, histories: Any, clocks: Any, paths: Any, h: float, steps: int, initialise: bool) -> None:
    """Advance all blocks by a control period, or complete them after a reset.

    Args:
        arenas: Shape (blocks, rows * LANES).
        histories: Shape (blocks, slots * 4 * LANES).
        clocks: Shape (blocks, CLOCK, LANES).
        paths: of all lanes, see `reference_at`. Shape (paths, n, 5).
        h: step [s].
        steps: how many; 0 after a reset.
        initialise: complete the states first (after a reset).
    """
    for block in range(arenas.shape[0]):
        arena = arenas[block]
        history = histories[block]
        clock = clocks[block]
        if initialise:
            start(arena, history, clock, paths, h)
        else:
            evaluate_law(arena, history, clock, paths, h)
        for _ in range(steps):
            loop_step(arena, history, clock, paths, h)
        write_outputs(arena, history, clock, paths, h)
