"""Drivers of the closed loop's kernels: loops over lanes, stages, steps and blocks.

A *block* holds some environments, its lanes. All that is known of them is in its *arena*, one row of lanes for each
quantity (`rows.Row`); their late readings are in its *delay line*, a ring of slots of four rows: two readings, two
rates. `kernels` assembles these functions with recorded formulas into one module per variant and compiles that; here
they are plain Python for reading, checking and testing (`declarations.plain_python`).
"""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena, Arenas, Clock, Clocks, Histories, History, Paths
from flexarm_env.codegen.declarations import Program, per_lane
from flexarm_env.kernels.entries import clock_row
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.path_cache import cache_segment, invalidate_segment, on_segment, segment
from flexarm_env.kernels.recorded import law_kernel, outputs_kernel, reading_kernel
from flexarm_env.kernels.tableau import EXPLICIT, IMPLICIT, NODES, STAGES
from flexarm_env.kernels.variants import variant
from flexarm_env.physics.polyline import AHEAD, chord_at, reference_at


def prepare_commands(arena: Arena, clock: Clock, paths: Paths, h: float) -> None:
    """Write each joint's command for the step at hand: position at its start, and velocity.

    Within a step the reference runs along its chord. Where a corner falls inside, the velocity is then its mean over
    the step, so that the jump acts on the arm at the right time, to second order in the step.

    Args:
        arena: of one block.
        clock: of each lane, see `entries.ClockRow`. Shape (5, lanes).
        paths: of all lanes, see `reference_at`. Shape (paths, n, 5).
        h: step [s].
    """
    others = 0
    for i in range(variant.lanes):
        time = clock[clock_row.STEPS, i] * h - arena[row.COMMAND_DELAY, i]
        for r in range(2):
            here, there = (
                on_segment(arena, row.COMMAND_SEGMENT, i, r, time),
                on_segment(arena, row.COMMAND_SEGMENT, i, r, time + h),
            )
            velocity = (there - here) / h
            for joint in (row.COMMAND_1, row.COMMAND_2):
                arena[joint + r, i] = here
                arena[joint + 2 + r, i] = velocity
        others += not step_within_segment(arena, clock, i, time, h)
    for i in range(variant.lanes if others > 0 else 0):
        p, now, since = clock[clock_row.PATH, i], clock[clock_row.STEPS, i] * h, clock[clock_row.SINCE, i] * h
        late_1, late_2 = arena[row.COMMAND_DELAY, i], arena[row.COMMAND_DELAY + 1, i]
        if not step_within_segment(arena, clock, i, now - late_1, h):
            cache_segment(arena, row.COMMAND_SEGMENT, paths, p, now - late_1 + h, i)  # where the next step begins
            command_1 = chord_at(paths, p, now - late_1, h, since)
            command_2 = command_1
            if late_2 != late_1:
                command_2 = chord_at(paths, p, now - late_2, h, since)
            for r in range(4):
                arena[row.COMMAND_1 + r, i] = command_1[r]
                arena[row.COMMAND_2 + r, i] = command_2[r]


@per_lane
def step_within_segment(arena: Arena, clock: Clock, i: int, time: float, h: float) -> bool:
    """Whether lane i's commands run along the noted side in the whole step that begins at a time [s].

    One side is noted for both joints: commands that are late by different times are searched for in each step.
    """
    within = time - arena[row.COMMAND_SEGMENT + segment.LAP, i]
    begun = (within >= arena[row.COMMAND_SEGMENT + segment.BEGIN, i]) & (time >= clock[clock_row.SINCE, i] * h)
    together = arena[row.COMMAND_DELAY, i] == arena[row.COMMAND_DELAY + 1, i]
    return begun & together & (within + h < arena[row.COMMAND_SEGMENT + segment.END, i])


def prepare_readings(arena: Arena, history: History, clock: Clock, h: float, node: float) -> None:
    """Write the late readings for a stage at t + node h.

    Args:
        arena: of one block.
        history: readings at past steps, a ring. Shape (slots * 4, lanes).
        clock: of each lane, see `entries.ClockRow`. Shape (5, lanes).
        h: step [s].
        node: of the stage, 0 to 1.
    """
    slots = history.shape[0] // 4
    slot = clock[clock_row.HEAD, 0]
    if variant.law_on_sensor:
        for i in range(variant.lanes):
            for j in range(2):
                prepare_reading(arena, history, slots, slot, i, j, h, node)


@per_lane
def delayed_reading(
    history: History, slots: int, slot: int, i: int, j: int, h: float, back: float
) -> tuple[float, float]:
    """Reading j of lane i and its rate, `back` steps before the slot of the present one; see `prepare_reading`."""
    if back == 0.0:
        return history[4 * slot + j, i], history[4 * slot + 2 + j, i]
    first, last, u = bracket(slots, slot, back)
    return hermite(
        history[first + j, i],
        history[last + j, i],
        history[first + 2 + j, i],
        history[last + 2 + j, i],
        h,
        u,
    )


@per_lane
def bracket(slots: int, slot: int, back: float) -> tuple[int, int, float]:
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


@per_lane
def hermite(a: float, b: float, a_rate: float, b_rate: float, h: float, u: float) -> tuple[float, float]:
    """Value and rate a share u of a step h after a, by the cubic with these values and rates at its ends."""
    a_rise, b_rise = h * a_rate, h * b_rate
    difference = b - a
    curve = 3.0 * difference - 2.0 * a_rise - b_rise
    twist = a_rise + b_rise - 2.0 * difference
    return a + u * (a_rise + u * (curve + u * twist)), (a_rise + u * (2.0 * curve + u * 3.0 * twist)) / h


def prepare_reading(
    arena: Arena, history: History, slots: int, slot: int, i: int, j: int, h: float, node: float
) -> None:
    """Write offset and weight of reading j of lane i at t + node h (see `closed_loop.Law`).

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
        here = slot * 4
        u = position / node
        value = history[here + j, i]
        rate = history[here + 2 + j, i]
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


def slot_after(clock: Clock, history: History, steps: int) -> int:
    """Slot of a block's delay line that so many integration steps from now on will be the newest one."""
    return (clock[clock_row.HEAD, 0] + steps) % (history.shape[0] // 4)


def count_steps(clock: Clock, history: History, steps: int) -> None:
    """Count integration steps of every lane of a block, and move on in its delay line."""
    head = slot_after(clock, history, steps)
    for i in range(variant.lanes):
        clock[clock_row.STEPS, i] += steps
        clock[clock_row.HEAD, i] = head


def store_reading(arena: Arena, history: History, slot: int) -> None:
    """Enter the current readings into a slot of the delay line."""
    reading_kernel(arena, history[slot * 4 : (slot + 1) * 4])


def evaluate_law(arena: Arena, history: History, clock: Clock, paths: Paths, h: float) -> None:
    """The law's torque at the present instant with the present gain; mechanical acceleration as well."""
    prepare_commands(arena, clock, paths, h)
    prepare_readings(arena, history, clock, h, 0.0)
    law_kernel(arena, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))
    for r in range(2):
        for i in range(variant.lanes):
            arena[row.TORQUE + r, i] = arena[row.TAU + r, i]


def start(arena: Arena, history: History, clock: Clock, paths: Paths, h: float) -> None:
    """Complete every lane of a block from its state."""
    for i in range(variant.lanes):
        invalidate_segment(arena, row.COMMAND_SEGMENT, i)
    for at in range(STAGES * variant.size):  # what an earlier episode left, at worst not finite
        for i in range(variant.lanes):
            arena[row.V_SLOTS + at, i] = 0.0
            arena[row.MECHANICAL_SLOTS + at, i] = 0.0
            arena[row.FEEDBACK_SLOTS + at, i] = 0.0
    evaluate_law(arena, history, clock, paths, h)
    store_stage(arena, 0)


def store_stage(arena: Arena, slot: int) -> None:
    """Keep what the law's kernel found for the stages to come."""
    for r in range(variant.size):
        for i in range(variant.lanes):
            at = slot * variant.size + r
            arena[row.V_SLOTS + at, i] = arena[row.V_STAGE + r, i]
            arena[row.MECHANICAL_SLOTS + at, i] = arena[row.MECHANICAL + r, i]
            arena[row.FEEDBACK_SLOTS + at, i] = arena[row.FEEDBACK + r, i]


def loop_step(arena: Arena, history: History, clock: Clock, paths: Paths, h: float) -> None:
    """One step of the closed loop on every lane of a block."""
    prepare_commands(arena, clock, paths, h)
    for stage in range(STAGES):
        prepare_readings(arena, history, clock, h, NODES[stage])
        law_kernel(arena, h, h * NODES[stage], EXPLICIT[stage], IMPLICIT[stage])
        if stage + 1 < STAGES:
            store_stage(arena, stage + 1)
    for r in range(variant.size):
        for i in range(variant.lanes):
            arena[row.Y + r, i] = arena[row.Y_STAGE + r, i]
            arena[row.V + r, i] = arena[row.V_STAGE + r, i]
    store_stage(arena, 0)  # the last stage is the step's end, where the next step starts
    count_steps(clock, history, 1)
    store_reading(arena, history, clock[clock_row.HEAD, 0])


def state_status(arena: Arena) -> None:
    """Status of every lane: 0 for a valid state; -1 if it is not finite; n if its entry n - 1 is beyond its limit."""
    for i in range(variant.lanes):
        status = 0.0
        for r in range(2 * variant.size - 1, -1, -1):
            beyond = not abs(arena[row.STATE + r, i]) <= arena[row.LIMITS + r, i]
            status = r + 1.0 if beyond else status
        for r in range(2 * variant.size):
            value = arena[row.STATE + r, i]
            status = status if value - value == 0.0 else -1.0
        arena[row.STATUS, i] = status


def failures(size: int) -> dict[float, str | None]:
    """What a state's status means (`state_status`): why it is not valid; 0 is that of a valid one.

    Args:
        size: number of internal coordinates.
    """
    entries = ("angle", "angle", *["deflection"] * (size - 2), *["rate"] * size)
    return {0.0: None, -1.0: "diverged"} | {1.0 + n: reason for n, reason in enumerate(entries)}


def write_outputs(arena: Arena, history: History, clock: Clock, paths: Paths, h: float) -> None:
    """Observation, state, tips, reward and status of every lane of a block at the present instant."""
    prepare_readings(arena, history, clock, h, 0.0)
    for i in range(variant.lanes):
        steps = clock[clock_row.STEPS, i]
        reference = reference_at(
            paths, clock[clock_row.PATH, i], steps * h, (steps + AHEAD) * h, clock[clock_row.SINCE, i] * h
        )
        for r in range(4):
            arena[row.REFERENCE + r, i] = reference[r]
    outputs_kernel(arena)
    state_status(arena)


def run_loop(
    arenas: Arenas, histories: Histories, clocks: Clocks, paths: Paths, h: float, steps: int, initialise: bool
) -> None:
    """Advance all blocks by a control period, or complete them after a reset.

    Args:
        arenas: Shape (blocks, rows, lanes).
        histories: Shape (blocks, slots * 4, lanes).
        clocks: Shape (blocks, 5, lanes).
        paths: of all lanes, see `reference_at`. Shape (paths, n, 5).
        h: step [s].
        steps: how many; 0 after a reset.
        initialise: complete the states first (after a reset).
    """
    for block in range(arenas.shape[0]):
        arena: Arena = arenas[block]
        history: History = histories[block]
        clock: Clock = clocks[block]
        if initialise:
            start(arena, history, clock, paths, h)
        else:
            evaluate_law(arena, history, clock, paths, h)
        for _ in range(steps):
            loop_step(arena, history, clock, paths, h)
        write_outputs(arena, history, clock, paths, h)


LOOP = Program(
    "loop",
    entry_points=(run_loop, store_reading),
    groups=frozenset({"law", "loop"}),
    words="the paper's closed loop",
)
