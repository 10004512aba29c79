"""The implicit-explicit integrator under the paper's law: one stage, recorded; drivers over lanes, stages and steps.

A *block* holds some environments, its lanes. All that is known of them is in its *arena*, one row of lanes for each
quantity (`layout.Row`); their late readings are in its *delay line* (`delay_line`). These functions are compiled
as they stand for each variant (`compiler`), and run in plain Python for reading, checking and testing
(`declarations.plain_python`).
"""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena, Clock, Four
from flexarm_env.codegen.declarations import per_lane
from flexarm_env.control import jacobian_transpose
from flexarm_env.kernels.delay_line import count_steps, prepare_readings, store_reading
from flexarm_env.kernels.entries import clock_row, segment
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.recorder import Recorder, recorded_kernel
from flexarm_env.kernels.reference import cache_segment, invalidate_segment, on_segment
from flexarm_env.kernels.tableau import EXPLICIT, GAMMA, IMEX_STAGES, IMPLICIT, NODES
from flexarm_env.kernels.variants import Block, variant
from flexarm_env.physics.polyline import chord_at


@recorded_kernel
def law_kernel(r: Recorder, arena: Arena, h: float, ahead: float, explicit: Four, implicit: Four) -> None:
    """Compute one stage of the closed loop of every lane: earlier stages, then `jacobian_transpose.law_stage`.

    Args:
        r: records it.
        arena: arena of one block; results in Y_STAGE, V_STAGE, MECHANICAL, FEEDBACK, TAU.
        h: step [s].
        ahead: time of the stage after the step's start [s].
        explicit: coefficients of the stages before, explicit part.
        implicit: the same, implicit part.
    """
    y, v_known = r.read("Y"), r.read("V")
    size = len(y)
    slots = [r.read(name) for name in ("V_SLOTS", "MECHANICAL_SLOTS", "FEEDBACK_SLOTS")]
    for slot in range(IMEX_STAGES):
        explicit_part, implicit_part = (h * r.trace.number(name, slot) for name in ("explicit", "implicit"))
        v, mechanical, feedback = (values[slot * size : (slot + 1) * size] for values in slots)
        y = [a + explicit_part * b for a, b in zip(y, v, strict=True)]
        v_known = [
            a + (explicit_part * b + implicit_part * c) for a, b, c in zip(v_known, mechanical, feedback, strict=True)
        ]
    law = r.law()
    here = [[x + vx * ahead, y + vy * ahead, vx, vy] for x, y, vx, vy in (law.command_1, law.command_2)]
    law = law._replace(command_1=here[0], command_2=here[1])
    options = (r.variant.complete, r.variant.sensor if r.variant.law_on_sensor else "rigid", r.variant.rate_jacobian)
    stage = jacobian_transpose.law_stage(r.constants(), r.elimination(), law, options, y, v_known, h * GAMMA)
    r.write("Y_STAGE", y)
    r.write("V_STAGE", stage.v)
    r.write("MECHANICAL", stage.mechanical)
    r.write("FEEDBACK", stage.feedback)
    r.write("TAU", stage.tau)


def prepare_commands(block: Block, h: float) -> None:
    """Write each joint's command for the step at hand: position at its start, and velocity.

    Within a step the reference runs along its chord. Where a corner falls inside, the velocity is then its mean over
    the step, so that the jump acts on the arm at the right time, to second order in the step.

    Args:
        block: the block.
        h: step [s].
    """
    arena, clock, paths = block.arena, block.clock, block.paths
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
    """Return whether lane i's commands run along the noted side in the whole step that begins at a time [s].

    One side is noted for both joints: commands that are late by different times are searched for in each step.
    """
    within = time - arena[row.COMMAND_SEGMENT + segment.LAP, i]
    begun = (within >= arena[row.COMMAND_SEGMENT + segment.BEGIN, i]) & (time >= clock[clock_row.SINCE, i] * h)
    together = arena[row.COMMAND_DELAY, i] == arena[row.COMMAND_DELAY + 1, i]
    return begun & together & (within + h < arena[row.COMMAND_SEGMENT + segment.END, i])


def evaluate_law(block: Block, h: float) -> None:
    """Compute the law's torque at the present instant with the present gain, and the accelerations (`law_kernel`)."""
    prepare_commands(block, h)
    prepare_readings(block, h, 0.0)
    law_kernel(block.arena, 0.0, 0.0, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))


def store_stage(arena: Arena, slot: int) -> None:
    """Keep what the law's kernel found for the stages to come."""
    for r in range(variant.size):
        for i in range(variant.lanes):
            at = slot * variant.size + r
            arena[row.V_SLOTS + at, i] = arena[row.V_STAGE + r, i]
            arena[row.MECHANICAL_SLOTS + at, i] = arena[row.MECHANICAL + r, i]
            arena[row.FEEDBACK_SLOTS + at, i] = arena[row.FEEDBACK + r, i]


def loop_step(block: Block, h: float) -> None:
    """Advance the closed loop of every lane of a block by one step."""
    arena, history, clock = block.arena, block.history, block.clock
    prepare_commands(block, h)
    for stage in range(IMEX_STAGES):
        prepare_readings(block, h, NODES[stage])
        law_kernel(arena, h, h * NODES[stage], EXPLICIT[stage], IMPLICIT[stage])
        if stage + 1 < IMEX_STAGES:
            store_stage(arena, stage + 1)
    for r in range(variant.size):
        for i in range(variant.lanes):
            arena[row.Y + r, i] = arena[row.Y_STAGE + r, i]
            arena[row.V + r, i] = arena[row.V_STAGE + r, i]
    store_stage(arena, 0)  # the last stage is the step's end, where the next step starts
    count_steps(clock, history, 1)
    store_reading(arena, history, clock[clock_row.HEAD, 0])


def prepare_law(arena: Arena, i: int) -> None:
    """Set the delays and weights of the tip law in lane i, and the gain 0."""
    for r in range(2):
        late = arena[row.SENSOR_DELAY + r, i] if variant.law_on_sensor else 0.0
        shared = arena[row.SENSOR_DELAY, i]
        compensation = arena[row.COMPENSATION, i]
        command = 0.0 if compensation == 0.0 else shared if compensation == 1.0 else late
        arena[row.DELAY + r, i] = late
        arena[row.COMMAND_DELAY + r, i] = command
        arena[row.WEIGHT + r, i] = 1.0
        arena[row.RATE_WEIGHT + r, i] = 1.0
    arena[row.GAIN, i] = 0.0
    invalidate_segment(arena, row.COMMAND_SEGMENT, i)


def start_law(block: Block, h: float) -> None:
    """Initialise the started lanes for the implicit integrator; the other lanes do not change.

    Args:
        block: the block.
        h: step [s].
    """
    arena, started = block.arena, block.started
    for at in range(IMEX_STAGES * variant.size):  # an earlier run may have left numbers that are not finite
        for i in range(variant.lanes):
            if started[i]:
                arena[row.V_SLOTS + at, i] = 0.0
                arena[row.MECHANICAL_SLOTS + at, i] = 0.0
                arena[row.FEEDBACK_SLOTS + at, i] = 0.0
    evaluate_law(block, h)
    for r in range(variant.size):
        for i in range(variant.lanes):
            if started[i]:
                arena[row.V_SLOTS + r, i] = arena[row.V_STAGE + r, i]
                arena[row.MECHANICAL_SLOTS + r, i] = arena[row.MECHANICAL + r, i]
                arena[row.FEEDBACK_SLOTS + r, i] = arena[row.FEEDBACK + r, i]
