"""The blocks of which observations consist: each declared once, with what it tells of the arm.

A block holds only what sensors and the task's clock can measure; `state` and `episode_parameters` are privileged.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from flexarm_env.actions import MODES
from flexarm_env.envs.bounds import (
    MOST_SECONDS,
    Range,
    Workspace,
    even_range,
    gauged_range,
    joint_rate_bound,
    measured_angle_bounds,
    measured_rate_bound,
    modal_range,
    position_bounds,
)
from flexarm_env.envs.quantities import orderable
from flexarm_env.envs.sensors import ANGLE, FURTHER, LINK_2, SCALAR, SENSORS, VECTOR, Part, Sensor, mounting
from flexarm_env.envs.settings import Settings
from flexarm_env.kernels.entries import DRAWN
from flexarm_env.physics.sensing import POSITION
from flexarm_env.simulation.limits import ANGLE_LIMITS, RATE_LIMIT

# What a policy may learn of the arm and its task beyond the clock, the reference of this instant and its own actions.
ENCODERS, STRAIN_GAUGES, PREVIEW, TIME_STAMPS = "encoders", "strain gauges", "preview", "time stamps"
PLANT, TRUE_STATE, EPISODE = "plant parameters", "true state", "episode parameters"
INFORMATION = {
    ENCODERS: "angles and rates of the joints",
    **{sensor.reads: f"the {sensor.title}, late" for sensor in SENSORS},
    TIME_STAMPS: "when the latest reading of the sensor on link 2 was taken, whose delay may be drawn",
    STRAIN_GAUGES: "how far the links bend and how fast, without delay or noise",
    PREVIEW: "where the target will be",
    PLANT: "the nominal arm's masses, stiffness and modes; in no block, but a controller may be designed on them",
    TRUE_STATE: "the arm's whole state, which no sensor delivers",
    EPISODE: "delays, payload, stiffness, damping and noise of the episode",
}
PRIVILEGED = (TRUE_STATE, EPISODE)  # readings of which no real arm has a sensor
PARAMETER_SCALES = [0.05, 1.0, 1.0, 0.02, 0.02, 0.02]  # as of `DRAWN`, for usual draws; the same in a whole batch


@dataclass(frozen=True)
class Block:
    """Declaration of a block of observations.

    Attributes:
        what: description.
        unit: unit of its numbers.
        rows: function that returns the part of the arena that holds it, the first number there, and their count.
        limits: function that returns scales and bounds.
        mirror: signs of its numbers in the mirrored episode, repeated over the block (`sensors.VECTOR`);
            None: the action's signs.
        reads: what it tells, one of `INFORMATION`; None: the clock, the present reference, or the agent's own actions.
        count: number of its numbers, as text with m modes a link.
        modes: action modes that have it.
    """

    what: str
    unit: str
    rows: Callable[[Settings], tuple[str, int, int]]
    limits: Callable[[Settings, Workspace], Range]
    mirror: tuple[int, ...] | None
    reads: str | None
    count: str = "2"
    modes: tuple[str, ...] = tuple(MODES)


def _rows(name: str, first: int = 0, count: int = 2) -> Callable[[Settings], tuple[str, int, int]]:
    return lambda settings: (name, first, count)


def _modes(settings: Settings) -> int:
    return settings.flexible_arm.parameters.modes_per_link


def _direction_range(settings: Settings, workspace: Workspace) -> Range:
    """Cosine and sine of an angle."""
    return even_range(2, 1.0, 1.0 + 1e-9)


def _half_turn_range(settings: Settings, workspace: Workspace) -> Range:
    """Differences of two angles that are within half a turn."""
    return even_range(2, 0.3, np.pi + 1e-9)


def _state_range(settings: Settings) -> Range:
    """Put joints and modes together in the order of the state."""
    modes, rates = modal_range(settings, rates=False), modal_range(settings, rates=True)
    scale = [np.pi] * 2 + modes.scale + [3.0] * 2 + rates.scale
    return Range(scale, [*ANGLE_LIMITS, *modes.bound, RATE_LIMIT, RATE_LIMIT, *rates.bound])


def _blocks_of(sensor: Sensor) -> dict[str, Block]:
    blocks, first = {}, 0
    for part in sensor.parts:
        blocks[part.block] = _block_of(sensor, part, first)
        first += part.size
    return blocks | ({sensor.error.block: _block_of(sensor, sensor.error, 0)} if sensor.error else {})


def _block_of(sensor: Sensor, part: Part, first: int) -> Block:
    """Return the block of a part of a sensor's reading, whose first number is given, or of its error."""
    is_error, is_position = part is sensor.error, sensor.quantity == POSITION

    def rows(settings: Settings) -> tuple[str, int, int]:
        """Positions and errors are read in the frame of the observation."""
        if sensor is LINK_2:
            return "F_SENSOR_ERROR" if is_error else "F_LINK_SENSOR", first, part.size
        name = "F_FURTHER_ERROR" if is_error else "F_FURTHER_READING" if is_position else "FURTHER_READING"
        return name, mounting(settings, sensor).first + first, part.size

    def limits(settings: Settings, reach: Workspace) -> Range:
        """Bound positions by the arm's reach, other quantities by the sensor's range."""
        if is_position:
            bound = position_bounds(settings, sensor, reach)[is_error]
        else:
            bound = mounting(settings, sensor).range[first]
        return even_range(part.size, part.scale, bound)

    return Block(part.what, part.unit, rows, limits, part.mirror, reads=sensor.reads, count=str(part.size))


BLOCKS: dict[str, Block] = {
    "joint_angles": Block(
        "theta1, theta2 by the encoders",
        "rad",
        _rows("ENCODERS"),
        lambda s, r: Range([np.pi] * 2, measured_angle_bounds(s)),
        ANGLE,
        reads=ENCODERS,
    ),
    "elbow_direction": Block(
        "cosine and sine of theta2",
        "1",
        _rows("F_DIRECTIONS"),
        _direction_range,
        VECTOR,
        reads=ENCODERS,
    ),
    "shoulder_direction": Block(
        "cosine and sine of theta1",
        "1",
        _rows("F_DIRECTIONS", 2),
        _direction_range,
        VECTOR,
        reads=ENCODERS,
    ),
    "joint_rates": Block(
        "rates of theta1, theta2 by the encoders",
        "rad/s",
        _rows("ENCODERS", 2),
        lambda s, r: even_range(2, 3.0, measured_rate_bound(s)),
        ANGLE,
        reads=ENCODERS,
    ),
    "joint_error": Block(
        "joint angles of the rigid arm on the target, with its elbow on the side of `elbow_branch`, minus the "
        "measured ones, within half a turn",
        "rad",
        _rows("F_JOINT_ERROR"),
        _half_turn_range,
        ANGLE,
        reads=ENCODERS,
    ),
    "joint_error_rate": Block(
        "joint rates of that arm minus the measured ones",
        "rad/s",
        _rows("F_JOINT_ERROR_RATE"),
        lambda s, r: even_range(2, 3.0, joint_rate_bound(s, r)),
        ANGLE,
        reads=ENCODERS,
    ),
    "present_joint_error": Block(
        "as `joint_error`, with the rigid arm's elbow on the side on which the measured elbow is",
        "rad",
        _rows("F_PRESENT_JOINT_ERROR"),
        _half_turn_range,
        ANGLE,
        reads=ENCODERS,
    ),
    "present_joint_error_rate": Block(
        "as `joint_error_rate`, for that arm",
        "rad/s",
        _rows("F_PRESENT_JOINT_ERROR_RATE"),
        lambda s, r: even_range(2, 3.0, joint_rate_bound(s, r)),
        ANGLE,
        reads=ENCODERS,
    ),
    "encoder_error": Block(
        "target minus the tip by rigid kinematics of the measured angles",
        "m",
        _rows("F_ENCODER_ERROR"),
        lambda s, r: even_range(2, 0.5, r.radius + s.flexible_arm.parameters.reach),
        VECTOR,
        reads=ENCODERS,
    ),
    **_blocks_of(LINK_2),
    "sensor_error_rate": Block(
        "change of `sensor_error` since the reading before, per second",
        "m/s",
        _rows("F_SENSOR_ERROR_RATE"),
        lambda s, r: even_range(2, 3.0, 2.0 * position_bounds(s, LINK_2, r)[1] / (0.499 * s.control_period)),
        VECTOR,
        reads=LINK_2.reads,
    ),
    "reading_age": Block(
        "age of the latest reading of the sensor on link 2 by its time stamp: drawn delay, jitter and lost readings "
        "included; of two delays the shoulder's",
        "s",
        _rows("READING_AGE", 0, 1),
        lambda s, r: even_range(1, 0.05, MOST_SECONDS),
        SCALAR,
        reads=TIME_STAMPS,
        count="1",
    ),
    **{name: block for sensor in FURTHER for name, block in _blocks_of(sensor).items()},
    "modal_coordinates": Block(
        "of link 1, of link 2, from strain gauges",
        "1",
        lambda s: ("GAUGES", 0, 2 * _modes(s)) if s.drifting else ("STATE", 2, 2 * _modes(s)),
        lambda s, r: gauged_range(s, rates=False),
        ANGLE,
        reads=STRAIN_GAUGES,
        count="2 m",
    ),
    "modal_rates": Block(
        "rates of the modal coordinates",
        "1/s",
        lambda s: (
            ("GAUGES", 2 * _modes(s), 2 * _modes(s)) if s.drifting else ("STATE", 4 + 2 * _modes(s), 2 * _modes(s))
        ),
        lambda s, r: gauged_range(s, rates=True),
        ANGLE,
        reads=STRAIN_GAUGES,
        count="2 m",
    ),
    "reference_position": Block(
        "where the tip should be",
        "m",
        _rows("F_REFERENCE"),
        lambda s, r: even_range(2, 6.3, r.radius + 1e-9),
        VECTOR,
        reads=None,
    ),
    "reference_velocity": Block(
        "its velocity; at a corner that of the side that begins",
        "m/s",
        _rows("F_REFERENCE_VELOCITY"),
        lambda s, r: even_range(2, 3.15, r.speed * (1.0 + 1e-9)),
        VECTOR,
        reads=None,
    ),
    "previews": Block(
        "how far the target will have moved at each horizon: x and y of the first, of the second, ...",
        "m",
        lambda s: ("TAIL", 0, 2 * len(s.previews)),
        lambda s, r: even_range(2 * len(s.previews), 2.0, 2.0 * r.radius + 1e-9),
        VECTOR,
        reads=PREVIEW,
        count="2 per horizon",
    ),
    "last_actions": Block(
        "the last actions, limited to [-1, 1], the newest first",
        "1",
        lambda s: ("TAIL", 2 * len(s.previews), s.last_actions * len(s.action_limit)),
        lambda s, r: even_range(s.last_actions * len(s.action_limit), 1.0, 1.0),
        None,
        reads=None,
        count="action size per action",
    ),
    "torque": Block(
        "commanded torque of the motors, which `actuation_delay` makes act later; what the next action changes",
        "N m",
        lambda s: ("TAIL", 2 * len(s.previews) + s.kept_actions * len(s.action_limit), 2),
        lambda s, r: Range(list(s.motor_limit), list(s.motor_limit)),
        ANGLE,
        reads=None,
        modes=tuple(name for name, mode in MODES.items() if mode.accumulates),
    ),
    "lap_phase": Block(
        "cosine and sine of the share of the lap that is done, as an angle",
        "1",
        _rows("F_PHASE"),
        _direction_range,
        SCALAR,
        reads=None,
    ),
    "time": Block(
        "since the episode began; where scaled, in laps",
        "s",
        _rows("TIME", 0, 1),
        lambda s, r: even_range(1, s.lap_time, MOST_SECONDS),
        SCALAR,
        reads=None,
        count="1",
    ),
    "inner_gain": Block(
        "lambda of the period that ended",
        "1",
        _rows("EFFECTIVE_GAIN", 0, 1),
        lambda s, r: even_range(1, s.gain_limit, s.gain_limit),
        SCALAR,
        reads=None,
        count="1",
        modes=("gain",),
    ),
    "state": Block(
        "the arm's true state: theta1, theta2, modal coordinates of link 1 and of link 2, and the rates of all; for "
        "yardsticks that know everything (privileged), no sensor delivers it",
        "rad, 1, rad/s, 1/s",
        lambda s: ("STATE", 0, 4 + 4 * _modes(s)),
        lambda s, r: _state_range(s),
        ANGLE,
        reads=TRUE_STATE,
        count="4 + 4 m",
    ),
    "episode_parameters": Block(
        "quantities of the episode, drawn or not: " + ", ".join(DRAWN) + "; privileged",
        "s, kg, 1, 1, m, s",
        _rows("EPISODE", 0, len(DRAWN)),
        lambda s, r: Range(PARAMETER_SCALES, [orderable(s, name)[1] for name in DRAWN]),
        SCALAR,
        reads=EPISODE,
        count=str(len(DRAWN)),
    ),
}
