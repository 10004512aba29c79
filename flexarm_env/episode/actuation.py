"""Drivers of the ways in which an action moves the arm over a control period; a program has one of them, as `drive`.

`imex` explains lanes, blocks and arenas. A torque or a gain is held for one period, which begins `actuation_delay`
after its action. `DRIVES` names the drivers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from numpy import floor

from flexarm_env.codegen.arrays import Arena, LaneRow, Words
from flexarm_env.codegen.declarations import Chosen, Function, per_lane
from flexarm_env.codegen.scalars import clip
from flexarm_env.episode.disturbances import push_tips
from flexarm_env.episode.features import joint_kernel
from flexarm_env.episode.payload import change_payloads
from flexarm_env.episode.race import move_references
from flexarm_env.kernels.delay_line import count_steps, is_kept, slot_after, store_reading
from flexarm_env.kernels.entries import clock_row, drawn, setting, word
from flexarm_env.kernels.imex import evaluate_law, loop_step
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.recorded import step_kernel
from flexarm_env.kernels.variants import Block, variant
from flexarm_env.physics.polyline import reference_at

Factors = tuple[float, float, float, float, float, float, float, float]


class Drive(NamedTuple):
    """A way in which an action moves the arm.

    Attributes:
        driver: function that moves the arm over a control period.
        groups: names of the groups of rows that it needs (`kernels.layout`).
        description: for the message that is shown while it compiles.
    """

    driver: Function
    groups: tuple[str, ...]
    description: str


DRIVES: dict[str, Drive] = {}  # by the name of the program (`actions.ActionMode.program`)
HOST_DRIVES: dict[str, Drive] = {}  # those that leave the commands to the host of another plant


def drives(
    program: str, description: str, *groups: str, among: dict[str, Drive] = DRIVES
) -> Callable[[Function], Function]:
    """Register a driver as the `drive` of a program; see `Drive`."""

    def enter(driver: Function) -> Function:
        among[program] = Drive(driver, groups, description)
        return driver

    return enter


@Chosen
def drive(block: Block) -> None:
    """Move the arm over a control period: one of `DRIVES`, as the program says."""


def make_room(arena: Arena, header: Words, newest: int) -> None:
    """Shift a block's stored actions (or commands, from the row `newest` on) back by one control period."""
    channels = header[word.CHANNELS]
    for at in range(newest + header[word.KEPT_ACTIONS] * channels - 1, newest + channels - 1, -1):
        kept: LaneRow = arena[at]
        later: LaneRow = arena[at - channels]
        for i in range(variant.lanes):
            kept[i] = later[i]


@per_lane
def allowed_command(arena: Arena, i: int, r: int, value: float) -> float:
    """Return a command of channel r of lane i as its motor takes it: the nearest multiple of its resolution."""
    if variant.motors:
        unit = arena[row.TORQUE_UNIT + r, i]
        if unit > 0.0:
            count = min(floor(abs(value) / unit + 0.5), arena[row.TORQUE_LEVELS + r, i])
            value = count * unit if value > 0.0 else -count * unit
    return value


def command(block: Block, i: int, r: int, begin: float) -> float:
    """Return the mean command that acts on channel r of lane i in an integration step, as a share of `COMMAND_SCALE`.

    Args:
        block: the block.
        i: the lane.
        r: the channel.
        begin: start of the integration step, from the start of the period [s].
    """
    header, settings, arena = block.header, block.settings, block.arena
    newest = row.TAIL + header[word.COMMANDS] + r
    late = arena[row.EPISODE + drawn.ACTUATION_DELAY, i]
    if late == 0.0:
        return allowed_command(arena, i, r, arena[newest, i])
    start = (begin - late) / settings[setting.PERIOD] + 1e-9  # in periods, of the moment at which the command was given
    length = settings[setting.STEP] / settings[setting.PERIOD]
    whole = floor(start)
    back = -int(whole)  # 0: the present action acts, 1: the one before, ...
    value = allowed_command(arena, i, r, arena[newest + back * header[word.CHANNELS], i])
    before_switch = (whole + 1.0 - start) / length
    if back == 0 or before_switch >= 1.0 - 1e-6:
        return value
    next_value = allowed_command(arena, i, r, arena[newest + (back - 1) * header[word.CHANNELS], i])
    return before_switch * value + (1.0 - before_switch) * next_value


def undelayed(arena: Arena) -> bool:
    """Return whether no lane has an actuation delay, so that commands are constant over a control period."""
    delayed = 0
    for i in range(variant.lanes):
        delayed += arena[row.EPISODE + drawn.ACTUATION_DELAY, i] > 0.0
    return delayed == 0


def write_commands(block: Block, step: int, held: bool) -> None:
    """Write the commanded torques of an integration step: the mean over the step if a command changes within it."""
    header, settings, arena = block.header, block.settings, block.arena
    begin = step * settings[setting.STEP]
    newest = row.TAIL + header[word.COMMANDS]
    for r in range(2):
        scale: LaneRow = arena[row.COMMAND_SCALE + r]
        torques: LaneRow = arena[row.TAU + r]
        commands: LaneRow = arena[newest + r]
        for i in range(variant.lanes if held else 0):
            torques[i] = scale[i] * commands[i]
        if variant.motors:
            for i in range(variant.lanes if held else 0):
                torques[i] = scale[i] * allowed_command(arena, i, r, commands[i])
        if variant.disturbed:
            for i in range(0 if held else variant.lanes):
                torques[i] = scale[i] * command(block, i, r, begin)


def keep_reading(block: Block, done: int) -> None:
    """Write the reading after `done` steps of a period into the delay line, if `Header.KEPT_READINGS` has it."""
    header, arena, history, clock = block.header, block.arena, block.history, block.clock
    if is_kept(header, done):
        store_reading(arena, history, slot_after(clock, history, done))


@drives("torque", "actions are torques")
def drive_torque(block: Block) -> None:
    """Move the arm by torques that are the actions."""
    header, settings, arena, history, clock = block.header, block.settings, block.arena, block.history, block.clock
    held = undelayed(arena)
    for step in range(header[word.SUBSTEPS]):
        if step == 0 or not held:
            write_commands(block, step, held)
        for r in range(2 if step == 0 else 0):
            for i in range(variant.lanes):
                arena[row.TORQUE + r, i] = arena[row.TAU + r, i]
        if variant.payloads:
            change_payloads(block, step)
        if variant.pulses:
            push_tips(block, step)
        step_kernel(arena, settings[setting.STEP])
        if variant.motors:
            share = settings[setting.STEP] / settings[setting.PERIOD]
            for r in range(2):
                for i in range(variant.lanes):
                    before = arena[row.TORQUE + r, i] if step > 0 else 0.0
                    arena[row.TORQUE + r, i] = before + share * arena[row.ACTED + r, i]
        keep_reading(block, step + 1)
    count_steps(clock, history, header[word.SUBSTEPS])


def add_up_torques(block: Block) -> None:
    """Write a block's commanded torques: the previous ones plus the actions' changes, within the motors' limits."""
    header, settings, arena = block.header, block.settings, block.arena
    actions, torques = row.TAIL + 2 * header[word.PREVIEWS], row.TAIL + header[word.COMMANDS]
    make_room(arena, header, torques)
    for r in range(2):
        for i in range(variant.lanes):
            change, limit = arena[row.ACTION_SCALE + r, i] * settings[setting.PERIOD], arena[row.TORQUE_LIMIT + r, i]
            arena[torques + r, i] = clip(arena[torques + r, i] + change * arena[actions + r, i], -limit, limit)


@drives("race", "actions are torques and the speed of the reference", "race")
def drive_race(block: Block) -> None:
    """Move the arm by torques, and the reference along its path at a speed; both are the action."""
    move_references(block)
    drive_torque(block)


@drives("torque_rate", "actions are changes of the torques")
def drive_torque_rate(block: Block) -> None:
    """Move the arm by torques whose change per second is the action."""
    add_up_torques(block)
    drive_torque(block)


def spline_factors(u: float, period: float) -> Factors:
    """Return the factors of `joint_tracking.interpolated` at the share u of a period [s]."""
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


def plan_joint_spline(block: Block) -> None:
    """Plan the joint-space law's reference over the coming period: from the present joint aim to the aim at its end.

    A shift changes linearly from the last one to the commanded one. If a side of the path ends at the end of the
    period, the rates there are those of that side.
    """
    header, settings, arena, clock, paths = block.header, block.settings, block.arena, block.clock, block.paths
    h, period = settings[setting.STEP], settings[setting.PERIOD]
    for r in range(4):
        for i in range(variant.lanes):
            arena[row.INNER_FROM + r, i] = arena[row.REFERENCE_JOINTS + r, i]
    for i in range(variant.lanes):
        time = (clock[clock_row.STEPS, i] + header[word.SUBSTEPS]) * h
        there = reference_at(paths, clock[clock_row.PATH, i], time, time - 1e-3 * h, clock[clock_row.SINCE, i] * h)
        for r in range(4):
            arena[row.REFERENCE + r, i] = there[r]
    joint_kernel(arena, settings[setting.LENGTHS], settings[setting.LENGTHS + 1])
    for r in range(4):
        for i in range(variant.lanes):
            arena[row.INNER_TO + r, i] = arena[row.REFERENCE_JOINTS + r, i]
    if header[word.SHIFTING] > 0:
        for r in range(2):
            for i in range(variant.lanes):
                before = arena[row.SHIFT + r, i]
                shift = arena[row.COMMAND_SCALE + r, i] * command(block, i, r, period - h)
                rate = (shift - before) / period
                arena[row.INNER_FROM + r, i] += before
                arena[row.INNER_TO + r, i] += shift
                arena[row.INNER_FROM + 2 + r, i] += rate
                arena[row.INNER_TO + 2 + r, i] += rate
                arena[row.SHIFT + r, i] = shift


@drives("tracking", "actions are added to the joint-space tracking law", "tracking")
def drive_tracking(block: Block) -> None:
    """Move the arm by the joint-space tracking law, which follows the rigid arm on the reference, and the action."""
    header, settings, arena, history, clock = block.header, block.settings, block.arena, block.history, block.clock
    h, period = settings[setting.STEP], settings[setting.PERIOD]
    plan_joint_spline(block)
    held = undelayed(arena)
    for r in range(2):
        for i in range(variant.lanes):
            arena[row.TAU + r, i] = 0.0
    for step in range(header[word.SUBSTEPS]):
        if header[word.SHIFTING] == 0 and (step == 0 or not held):
            write_commands(block, step, held)
        if variant.payloads:
            change_payloads(block, step)
        if variant.pulses:
            push_tips(block, step)
        begin, middle, end = step * h / period, (step + 0.5) * h / period, (step + 1.0) * h / period
        step_kernel(
            arena, h, (spline_factors(begin, period), spline_factors(middle, period), spline_factors(end, period))
        )
        for r in range(2 if step == 0 else 0):
            for i in range(variant.lanes):
                arena[row.TORQUE + r, i] = arena[row.STAGE_TORQUE + r, i]
        keep_reading(block, step + 1)
    count_steps(clock, history, header[word.SUBSTEPS])


@drives("gain", "actions are the gain of the paper's law", "law")
def drive_gain(block: Block) -> None:
    """Move the arm by the paper's law, which acts in continuous time with the action as its gain lambda."""
    header, settings, arena = block.header, block.settings, block.arena
    h = settings[setting.STEP]
    held = undelayed(arena)
    for step in range(header[word.SUBSTEPS]):
        for i in range(variant.lanes if step == 0 or not held else 0):
            share = 0.5 * (command(block, i, 0, step * h) + 1.0)
            arena[row.GAIN, i] = arena[row.GAIN_LIMIT, i] * share
        if step == 0:
            evaluate_law(block, h)
            for i in range(variant.lanes):
                arena[row.EFFECTIVE_GAIN, i] = arena[row.GAIN, i]
                for r in range(2):
                    arena[row.TORQUE + r, i] = arena[row.TAU + r, i]
        loop_step(block, h)


@drives("gain", "actions are the gain of the paper's law, the plant is another engine's", among=HOST_DRIVES)
@drives("torque", "actions are torques, the plant is another engine's", among=HOST_DRIVES)
def host_commands(block: Block) -> None:
    """Write the commands that act in each integration step into the arena's tail, after the kept ones.

    They are shares of `COMMAND_SCALE`; the host converts them for the plant (`envs.hosted`). The clocks advance here.
    """
    header, settings, arena, history, clock = block.header, block.settings, block.arena, block.history, block.clock
    channels = header[word.CHANNELS]
    commands = row.TAIL + header[word.COMMANDS] + header[word.KEPT_ACTIONS] * channels
    for step in range(header[word.SUBSTEPS]):
        for r in range(channels):
            for i in range(variant.lanes):
                acting = command(block, i, r, step * settings[setting.STEP])
                arena[commands + step * channels + r, i] = acting
    count_steps(clock, history, header[word.SUBSTEPS])


@drives("torque_rate", "actions are changes of the torques, the plant is another engine's", among=HOST_DRIVES)
def host_torque_rate(block: Block) -> None:
    """Write the torques that the actions add up to; see `host_commands`."""
    add_up_torques(block)
    host_commands(block)
