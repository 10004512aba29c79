"""Drivers of the three ways in which an action moves the arm over a control period.

Assembled and compiled like `stepping`, which explains lanes, blocks and arenas. A module has one of the three, under
the name `drive`. Torques and gains are held over the period, each from its `actuation_delay` after the action on.
"""

from __future__ import annotations

from math import floor
from typing import Any

from flexarm_env.kernels.imex import PATH, SINCE, STEPS, count_steps, evaluate_law, loop_step, slot_after, store_reading
from flexarm_env.kernels.path_cache import reference_at
from flexarm_env.kernels.rk4 import step_kernel

LANES = 1
STEP = PERIOD = ACTION_SCALE = LENGTHS = BRANCH = SUBSTEPS = CHANNELS = PREVIEWS = SHIFTING = READINGS = 0
TAIL = EPISODE = TAU = TORQUE = STAGE_TORQUE = GAIN = EFFECTIVE_GAIN = 0
DISTURBED = False
JOINT = REFERENCE = INNER_FROM = INNER_TO = SHIFT = 0
DRAWN_ACTUATION_DELAY = 0  # place of the actuation delay among the quantities drawn for an episode


def joint_kernel(arena: Any, length_1: float, length_2: float, branch: float) -> None:
    """Joint angles and rates of the rigid arm on the reference, of every lane (recorded)."""
    raise NotImplementedError("the recorded kernel exists in assembled modules only")


def drive(arena: Any, history: Any, clock: Any, paths: Any, plan: Any, settings: Any) -> None:
    """One of the three below, as the module's kind says."""
    raise NotImplementedError("assembled modules have one of the three below under this name")


def command(arena: Any, plan: Any, settings: Any, i: int, r: int, begin: float) -> float:
    """Mean of the acting command in [-1, 1] of channel r of lane i over an integration step.

    Args:
        arena: of one block.
        plan: see `rows.PLAN`.
        settings: see `rows.SETTINGS`.
        i: the lane.
        r: the channel.
        begin: of the integration step after the start of the period [s].
    """
    newest = TAIL + 2 * plan[PREVIEWS] + r
    late = arena[i + (EPISODE + DRAWN_ACTUATION_DELAY) * LANES]
    if late == 0.0:
        return arena[i + newest * LANES]
    start = (begin - late) / settings[PERIOD] + 1e-9  # in periods, of the moment at which the command was given
    length = settings[STEP] / settings[PERIOD]
    whole = floor(start)
    back = -int(whole)  # 0: the present action acts, 1: the one before, ...
    value = arena[i + (newest + back * plan[CHANNELS]) * LANES]
    before_switch = (whole + 1.0 - start) / length
    if back == 0 or before_switch >= 1.0 - 1e-6:
        return value
    next_value = arena[i + (newest + (back - 1) * plan[CHANNELS]) * LANES]
    return before_switch * value + (1.0 - before_switch) * next_value


def prompt(arena: Any) -> bool:
    """Whether no lane has an actuation delay, so that commands do not change within a control period."""
    delayed = 0
    for i in range(LANES):
        delayed += arena[i + (EPISODE + DRAWN_ACTUATION_DELAY) * LANES] > 0.0
    return delayed == 0


def write_commands(arena: Any, plan: Any, settings: Any, step: int, held: bool) -> None:
    """Enter the commanded torques of an integration step, the mean over it where a command changes within."""
    begin = step * settings[STEP]
    newest = TAIL + 2 * plan[PREVIEWS]
    for r in range(2):
        scale = settings[ACTION_SCALE + r]
        torques = arena[(TAU + r) * LANES : (TAU + r + 1) * LANES]
        actions = arena[(newest + r) * LANES : (newest + r + 1) * LANES]
        for i in range(LANES if held else 0):
            torques[i] = scale * actions[i]
        if DISTURBED:
            for i in range(0 if held else LANES):
                torques[i] = scale * command(arena, plan, settings, i, r, begin)


def keep_reading(arena: Any, history: Any, clock: Any, plan: Any, done: int) -> None:
    """Enter the reading after so many steps of a period into the delay line, if it will be asked for (`READINGS`)."""
    if (plan[READINGS] >> ((done if done < plan[SUBSTEPS] else 0) & 63)) & 1:
        store_reading(arena, history, slot_after(clock, history, done))


def drive_torque(arena: Any, history: Any, clock: Any, paths: Any, plan: Any, settings: Any) -> None:
    """The action is the motors' torque.

    Args:
        arena: of one block.
        history: readings at past steps.
        clock: of each lane.
        paths: not used.
        plan: see `rows.PLAN`.
        settings: see `rows.SETTINGS`.
    """
    held = prompt(arena)
    for step in range(plan[SUBSTEPS]):
        if step == 0 or not held:
            write_commands(arena, plan, settings, step, held)
        for i in range(2 * LANES if step == 0 else 0):
            arena[i + TORQUE * LANES] = arena[i + TAU * LANES]
        step_kernel(arena, settings[STEP])
        keep_reading(arena, history, clock, plan, step + 1)
    count_steps(clock, history, plan[SUBSTEPS])


def hermite(u: float, period: float) -> tuple[float, float, float, float, float, float, float, float]:
    """Factors of `tracking.interpolated` a share u of a period [s] after its start."""
    v = 1.0 - u
    return (
        v * v * (1.0 + 2.0 * u),
        u * v * v * period,
        u * u * (3.0 - 2.0 * u),
        -(u * u * v) * period,
        -6.0 * u * v / period,
        v * (1.0 - 3.0 * u),
        6.0 * u * v / period,
        u * (3.0 * u - 2.0),
    )


def aim(arena: Any, clock: Any, paths: Any, plan: Any, settings: Any) -> None:
    """Where the inner law's reference runs in the coming period: from the present aim to that at its end.

    A shift runs linearly from the last one to the commanded one. The end's rates are those of the side that ends there.
    """
    h, period = settings[STEP], settings[PERIOD]
    for r in range(4):
        for i in range(LANES):
            arena[i + (INNER_FROM + r) * LANES] = arena[i + (JOINT + r) * LANES]
    for i in range(LANES):
        time = (clock[STEPS, i] + plan[SUBSTEPS]) * h
        there = reference_at(paths, clock[PATH, i], time, time - 1e-3 * h, clock[SINCE, i] * h)
        for r in range(4):
            arena[i + (REFERENCE + r) * LANES] = there[r]
    joint_kernel(arena, settings[LENGTHS], settings[LENGTHS + 1], settings[BRANCH])
    for r in range(4):
        for i in range(LANES):
            arena[i + (INNER_TO + r) * LANES] = arena[i + (JOINT + r) * LANES]
    if plan[SHIFTING] > 0:
        for r in range(2):
            for i in range(LANES):
                before = arena[i + (SHIFT + r) * LANES]
                shift = settings[ACTION_SCALE + r] * command(arena, plan, settings, i, r, period - h)
                rate = (shift - before) / period
                arena[i + (INNER_FROM + r) * LANES] += before
                arena[i + (INNER_TO + r) * LANES] += shift
                arena[i + (INNER_FROM + 2 + r) * LANES] += rate
                arena[i + (INNER_TO + 2 + r) * LANES] += rate
                arena[i + (SHIFT + r) * LANES] = shift


def drive_tracking(arena: Any, history: Any, clock: Any, paths: Any, plan: Any, settings: Any) -> None:
    """The inner joint-space law tracks the rigid arm's way along the reference; the action adds to it.

    Args:
        arena: of one block.
        history: readings at past steps.
        clock: of each lane.
        paths: of all lanes.
        plan: see `rows.PLAN`.
        settings: see `rows.SETTINGS`.
    """
    h, period = settings[STEP], settings[PERIOD]
    aim(arena, clock, paths, plan, settings)
    held = prompt(arena)
    for i in range(2 * LANES):
        arena[i + TAU * LANES] = 0.0
    for step in range(plan[SUBSTEPS]):
        if plan[SHIFTING] == 0 and (step == 0 or not held):
            write_commands(arena, plan, settings, step, held)
        begin, middle, end = step * h / period, (step + 0.5) * h / period, (step + 1.0) * h / period
        step_kernel(arena, h, (hermite(begin, period), hermite(middle, period), hermite(end, period)))
        for i in range(2 * LANES if step == 0 else 0):
            arena[i + TORQUE * LANES] = arena[i + STAGE_TORQUE * LANES]
        keep_reading(arena, history, clock, plan, step + 1)
    count_steps(clock, history, plan[SUBSTEPS])


def drive_gain(arena: Any, history: Any, clock: Any, paths: Any, plan: Any, settings: Any) -> None:
    """The action is the gain lambda of the paper's law, which acts in continuous time.

    Args:
        arena: of one block.
        history: readings at past steps.
        clock: of each lane.
        paths: of all lanes.
        plan: see `rows.PLAN`.
        settings: see `rows.SETTINGS`.
    """
    h = settings[STEP]
    held = prompt(arena)
    for step in range(plan[SUBSTEPS]):
        for i in range(LANES if step == 0 or not held else 0):
            arena[i + GAIN * LANES] = settings[ACTION_SCALE] * (
                0.5 * (command(arena, plan, settings, i, 0, step * h) + 1.0)
            )
        if step == 0:
            evaluate_law(arena, history, clock, paths, h)
            for i in range(LANES):
                arena[i + EFFECTIVE_GAIN * LANES] = arena[i + GAIN * LANES]
        loop_step(arena, history, clock, paths, h)
