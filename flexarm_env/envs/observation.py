"""Observations, declared by named blocks: vector, bounds, tables of the documentation all come from this declaration.

A block holds only what sensors and the task's clock can know.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.declarations import Program
from flexarm_env.envs.choices import MOVE_RING
from flexarm_env.envs.settings import Settings
from flexarm_env.kernels.layout import layout
from flexarm_env.physics.inverse_kinematics import LEAST_SINE
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.limits import ANGLE_LIMITS, RATE_LIMIT, state_limits
from flexarm_env.validation import choice

Array = NDArray[np.float64]
LARGEST_DEVIATE = 8.6  # of `random_stream.normal`


class Workspace(NamedTuple):
    """How far things can get before an episode ends [m], [m/s].

    Attributes:
        radius: of the reference from the shoulder.
        speed: of the reference.
        sensed: each coordinate of the sensor's reading.
        error: each coordinate of the sensor's error.
    """

    radius: float
    speed: float
    sensed: float
    error: float


class Range(NamedTuple):
    """Scales and bounds of a block's numbers; lengths as the block's.

    Attributes:
        scale: what the numbers are divided by where observations are scaled.
        bound: magnitudes that they cannot pass before the episode ends.
    """

    scale: list[float]
    bound: list[float]


@dataclass(frozen=True)
class Block:
    """One block.

    Attributes:
        what: description.
        unit: of its numbers.
        count: how many numbers, as text with m modes a link.
        rows: name of the arena's part it is read from, first number there, and how many.
        limits: scales and bounds.
    """

    what: str
    unit: str
    count: str
    rows: Callable[[Settings], tuple[str, int, int]]
    limits: Callable[[Settings, Workspace], Range]


def reach_of(settings: Settings) -> Workspace:
    """See `Workspace`."""
    arm = settings.flexible_arm
    length_1, length_2 = arm.parameters.link_lengths
    if settings.paths:
        tables = [path.table for path in settings.paths]
        radius = max(float(np.linalg.norm(table[:, 1:], axis=1).max()) for table in tables)
        moves = [np.diff(table, axis=0) for table in tables]
        speed = max(float((np.linalg.norm(move[:, 1:], axis=1) / move[:, 0]).max()) for move in moves)
    else:  # minimum-jerk moves of at most half a turn of each joint in a quarter of the lap
        radius = MOVE_RING[1] * arm.parameters.reach
        speed = 1.875 * np.pi / (0.25 * settings.lap_time) * (length_1 + 2.0 * length_2)
    bend = _bend(arm) if settings.sensor == "true" else 0.0
    deviation = settings.randomisation.get("noise", (0.0, settings.noise))[1]
    sensed = length_1 + settings.sensor_position + bend + LARGEST_DEVIATE * deviation
    return Workspace(radius, speed, sensed, sensed + radius)


def _bend(arm: FlexibleArm) -> float:
    """How far valid deflections may move the tip: each mode by its link's length across, and foreshortening [m]."""
    m = arm.parameters.modes_per_link
    across = m * sum(arm.parameters.link_lengths)
    if not arm.constants.foreshortened:
        return across
    largest = state_limits(arm)[2 : arm.size].reshape(2, m)
    sums = [np.abs(link.foreshortening(link.length)) for link in arm.modes]
    return across + float(sum(0.5 * q @ s @ q for q, s in zip(largest, sums, strict=True)))


def check_moving_start(settings: Settings, start: str) -> None:
    """Refuse a start on the move where the reference asks for joint rates that end an episode at once.

    Raises:
        ValueError: naming start and lap time.
    """
    if start not in ("moving", "mix"):
        return
    length_1, length_2 = settings.flexible_arm.parameters.link_lengths
    asked = reach_of(settings).speed * (length_1 + length_2) / (length_1 * length_2 * LEAST_SINE)
    if asked > RATE_LIMIT:
        raise ValueError(
            f"start = {start!r} with lap_time = {settings.lap_time} s: the reference may ask for {asked:.4g} rad/s "
            f"of a joint, and {RATE_LIMIT:g} end an episode; give a longer lap_time, or start at rest"
        )


def _even(count: int, scale: float, bound: float) -> Range:
    return Range([scale] * count, [bound] * count)


def _modal(settings: Settings, rates: bool) -> Range:
    """Scales: a first mode that bends its link's tip by 0.5 m, moving at 2 m/s; higher ones by a tenth, at half."""
    arm = settings.flexible_arm
    tips = np.concatenate([np.abs(link.tip_values) for link in arm.modes])
    order = np.tile(np.arange(arm.parameters.modes_per_link), 2)
    scale = np.where(order == 0, 2.0, 1.0) if rates else np.where(order == 0, 0.5, 0.05)
    bound = state_limits(arm)
    part = bound[arm.size + 2 :] if rates else bound[2 : arm.size]
    return Range((scale / tips).tolist(), part.tolist())


def _joint_rate_bound(settings: Settings, reach: Workspace) -> float:
    length_1, length_2 = settings.flexible_arm.parameters.link_lengths
    wanted = reach.speed * (length_1 + length_2) / (length_1 * length_2 * LEAST_SINE)
    return RATE_LIMIT + wanted + LARGEST_DEVIATE * settings.encoder_noise[1]


def _rows(name: str, first: int = 0, count: int = 2) -> Callable[[Settings], tuple[str, int, int]]:
    return lambda settings: (name, first, count)


def _modes(settings: Settings) -> int:
    return settings.flexible_arm.parameters.modes_per_link


BLOCKS: dict[str, Block] = {
    "joint_angles": Block(
        "theta1, theta2 by the encoders",
        "rad",
        "2",
        _rows("ENCODERS"),
        lambda s, r: Range([np.pi] * 2, [limit + LARGEST_DEVIATE * s.encoder_noise[0] for limit in ANGLE_LIMITS]),
    ),
    "elbow_direction": Block(
        "cosine and sine of theta2", "1", "2", _rows("F_DIRECTIONS"), lambda s, r: _even(2, 1.0, 1.0 + 1e-9)
    ),
    "shoulder_direction": Block(
        "cosine and sine of theta1", "1", "2", _rows("F_DIRECTIONS", 2), lambda s, r: _even(2, 1.0, 1.0 + 1e-9)
    ),
    "joint_rates": Block(
        "rates of theta1, theta2 by the encoders",
        "rad/s",
        "2",
        _rows("ENCODERS", 2),
        lambda s, r: _even(2, 3.0, RATE_LIMIT + LARGEST_DEVIATE * s.encoder_noise[1]),
    ),
    "joint_error": Block(
        "joint angles of the rigid arm on the reference minus the measured ones, within half a turn",
        "rad",
        "2",
        _rows("F_JOINT_ERROR"),
        lambda s, r: _even(2, 0.3, np.pi + 1e-9),
    ),
    "joint_error_rate": Block(
        "joint rates of the rigid arm on the reference minus the measured ones",
        "rad/s",
        "2",
        _rows("F_JOINT_ERROR_RATE"),
        lambda s, r: _even(2, 3.0, _joint_rate_bound(s, r)),
    ),
    "encoder_error": Block(
        "reference minus the tip by rigid kinematics of the measured angles",
        "m",
        "2",
        _rows("F_ENCODER_ERROR"),
        lambda s, r: _even(2, 0.5, r.radius + s.flexible_arm.parameters.reach),
    ),
    "sensed_position": Block(
        "latest reading of the sensor on link 2: late, noisy",
        "m",
        "2",
        _rows("F_LINK_SENSOR"),
        lambda s, r: _even(2, 6.3, r.sensed * 2**0.5),
    ),
    "sensor_error": Block(
        "reference at the time of that reading minus the reading",
        "m",
        "2",
        _rows("F_SENSOR_ERROR"),
        lambda s, r: _even(2, 0.5, r.error * 2**0.5),
    ),
    "sensor_error_rate": Block(
        "change of `sensor_error` since the reading before, per second",
        "m/s",
        "2",
        _rows("F_SENSOR_ERROR_RATE"),
        lambda s, r: _even(2, 3.0, 2.0 * r.error * 2**0.5 / (0.499 * s.control_period)),
    ),
    "modal_coordinates": Block(
        "of link 1, of link 2, from strain gauges",
        "1",
        "2 m",
        lambda s: ("STATE", 2, 2 * _modes(s)),
        lambda s, r: _modal(s, rates=False),
    ),
    "modal_rates": Block(
        "rates of the modal coordinates",
        "1/s",
        "2 m",
        lambda s: ("STATE", 4 + 2 * _modes(s), 2 * _modes(s)),
        lambda s, r: _modal(s, rates=True),
    ),
    "reference_position": Block(
        "where the tip should be", "m", "2", _rows("F_REFERENCE"), lambda s, r: _even(2, 6.3, r.radius + 1e-9)
    ),
    "reference_velocity": Block(
        "its velocity; at a corner that of the side that begins",
        "m/s",
        "2",
        _rows("F_REFERENCE_VELOCITY"),
        lambda s, r: _even(2, 3.15, r.speed * (1.0 + 1e-9)),
    ),
    "previews": Block(
        "how far the reference will have moved at each horizon: x and y of the first, of the second, ...",
        "m",
        "2 per horizon",
        lambda s: ("TAIL", 0, 2 * len(s.previews)),
        lambda s, r: _even(2 * len(s.previews), 2.0, 2.0 * r.radius + 1e-9),
    ),
    "last_actions": Block(
        "the last actions, limited to [-1, 1], the newest first",
        "1",
        "action size per action",
        lambda s: ("TAIL", 2 * len(s.previews), s.last_actions * len(s.action_limit)),
        lambda s, r: _even(s.last_actions * len(s.action_limit), 1.0, 1.0),
    ),
    "lap_phase": Block(
        "cosine and sine of the share of the lap that is done, as an angle",
        "1",
        "2",
        _rows("F_PHASE"),
        lambda s, r: _even(2, 1.0, 1.0 + 1e-9),
    ),
    "inner_gain": Block(
        'lambda of the period that ended (0 unless `action_mode` is "gain")',
        "1",
        "1",
        _rows("EFFECTIVE_GAIN", 0, 1),
        lambda s, r: _even(1, s.gain_limit, s.gain_limit),
    ),
}


class ObservationLayout(NamedTuple):
    """An observation's make-up.

    Attributes:
        blocks: where each block lies.
        rows: of the arena, one for each number. Shape (k,).
        scale: what each number was divided by. Shape (k,).
        bound: magnitude that no observation passes. Shape (k,), float32.
    """

    blocks: dict[str, slice]
    rows: NDArray[np.int64]
    scale: Array
    bound: NDArray[np.float32]


def observation_layout(settings: Settings, program: Program) -> ObservationLayout:
    """Lay out the observation that an environment's settings ask for.

    Args:
        settings: the settings.
        program: of the kernels.

    Raises:
        ValueError: for an unknown block.
    """
    places = layout(program, _modes(settings), settings.flexible_arm.constants.foreshortened)
    reach = reach_of(settings)
    blocks: dict[str, slice] = {}
    rows: list[int] = []
    scale: list[float] = []
    bound: list[float] = []
    for name in settings.observation:
        block = BLOCKS[choice("observation", name, BLOCKS)]
        part, first, count = block.rows(settings)
        limits = block.limits(settings, reach)
        blocks[name] = slice(len(rows), len(rows) + count)
        rows += range(places[part][0] + first, places[part][0] + first + count)
        scale += limits.scale if settings.scaled else [1.0] * count
        bound += limits.bound
    scales = np.array(scale)
    # rounded outwards: the float32 of a value at the bound must not pass it
    limit = np.nextafter((np.array(bound) / scales).astype(np.float32), np.float32(np.inf))
    return ObservationLayout(blocks, np.array(rows, dtype=np.int64), scales, limit)
