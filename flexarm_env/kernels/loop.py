"""The paper's closed loop as a program: arms start from given states, and their gains are held over a period.

`period` says what it shares with environments.
"""

from __future__ import annotations

from flexarm_env.codegen.arrays import Arena, Clock, History, Mask, Memory, Paths, Table, Words
from flexarm_env.codegen.declarations import Program, inlined_in_its_caller
from flexarm_env.kernels.delay_line import sensed_point
from flexarm_env.kernels.entries import clock_row, setting, word
from flexarm_env.kernels.imex import evaluate_law, loop_step
from flexarm_env.kernels.law import prepare_law
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.path_cache import invalidate_segment
from flexarm_env.kernels.period import step_blocks
from flexarm_env.kernels.recorded import truth_kernel
from flexarm_env.kernels.reference import follow_reference
from flexarm_env.kernels.states import enter_state
from flexarm_env.kernels.status import state_status
from flexarm_env.kernels.variants import variant


@inlined_in_its_caller
def hold_gains(
    memory: Memory,
    arena: Arena,
    history: History,
    clock: Clock,
    paths: Paths,
    header: Words,
    settings: Table,
    first: int,
) -> None:
    """Let the law act with the gains of the rows `Row.GAIN`; see `period.act`."""
    h = settings[setting.STEP]
    evaluate_law(arena, history, clock, paths, h)
    for _ in range(header[word.SUBSTEPS]):
        loop_step(arena, history, clock, paths, h)


@inlined_in_its_caller
def begin_runs(
    memory: Memory,
    arena: Arena,
    history: History,
    clock: Clock,
    paths: Paths,
    header: Words,
    settings: Table,
    first: int,
    started: Mask,
) -> None:
    """Put lanes at time 0 in the states of the rows `Row.STATE`; see `period.begin`."""
    for i in range(variant.lanes):
        if started[i]:
            clock[clock_row.STEPS, i] = 0
            enter_state(arena, i)
            prepare_law(arena, i)
            invalidate_segment(arena, row.PRESENT_SEGMENT, i)
            for r in range(2):
                arena[row.TORQUE + r, i] = 0.0


@inlined_in_its_caller
def report_runs(
    memory: Memory,
    arena: Arena,
    history: History,
    clock: Clock,
    paths: Paths,
    header: Words,
    settings: Table,
    first: int,
    started: Mask,
) -> None:
    """State, tips, reference, reading and status of every lane; see `period.report`."""
    truth_kernel(arena)
    follow_reference(arena, clock, paths, settings[setting.STEP])
    for i in range(variant.lanes):
        late, later = arena[row.SENSOR_DELAY, i], arena[row.SENSOR_DELAY + 1, i]
        x, y = sensed_point(arena, history, clock, settings, i, late, later)
        arena[row.LINK_SENSOR, i] = x + arena[row.NOISE, i]
        arena[row.LINK_SENSOR + 1, i] = y + arena[row.NOISE + 1, i]
    state_status(arena)


LOOP = Program(
    "loop",
    entry_points=(step_blocks,),
    groups=frozenset({"law", "loop"}),
    parts={"act": hold_gains, "begin": begin_runs, "report": report_runs},
    closed=True,
    words="the paper's closed loop",
)
