"""Observations, declared by named blocks: vector, bounds and documentation follow from the declarations.

A block holds only what sensors and the task's clock can measure.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.actions import MODES
from flexarm_env.codegen.declarations import Program
from flexarm_env.envs.bounds import (
    LARGEST_DEVIATE,
    Range,
    Workspace,
    even_range,
    joint_rate_bound,
    modal_range,
    reach_of,
)
from flexarm_env.envs.settings import Settings
from flexarm_env.kernels.entries import Shape
from flexarm_env.kernels.layout import Row
from flexarm_env.simulation.limits import ANGLE_LIMITS, RATE_LIMIT
from flexarm_env.validation import choice

Array = NDArray[np.float64]
# Signs of numbers in the mirrored episode, in which the y axis of every frame points the other way.
SCALAR, ANGLE, VECTOR = (1,), (-1,), (1, -1)


@dataclass(frozen=True)
class Block:
    """Declaration of a block of observations.

    Attributes:
        what: description.
        unit: unit of its numbers.
        count: number of its numbers, as text with m modes a link.
        rows: function that returns the part of the arena that holds it, the first number there, and their count.
        limits: function that returns scales and bounds.
        mirror: signs of its numbers in the mirrored episode, repeated over the block (`SCALAR`, `ANGLE`, `VECTOR`);
            None: the action's signs.
        modes: action modes that have it.
    """

    what: str
    unit: str
    count: str
    rows: Callable[[Settings], tuple[str, int, int]]
    limits: Callable[[Settings, Workspace], Range]
    mirror: tuple[int, ...] | None
    modes: tuple[str, ...] = tuple(MODES)


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
        ANGLE,
    ),
    "elbow_direction": Block(
        "cosine and sine of theta2",
        "1",
        "2",
        _rows("F_DIRECTIONS"),
        lambda s, r: even_range(2, 1.0, 1.0 + 1e-9),
        VECTOR,
    ),
    "shoulder_direction": Block(
        "cosine and sine of theta1",
        "1",
        "2",
        _rows("F_DIRECTIONS", 2),
        lambda s, r: even_range(2, 1.0, 1.0 + 1e-9),
        VECTOR,
    ),
    "joint_rates": Block(
        "rates of theta1, theta2 by the encoders",
        "rad/s",
        "2",
        _rows("ENCODERS", 2),
        lambda s, r: even_range(2, 3.0, RATE_LIMIT + LARGEST_DEVIATE * s.encoder_noise[1]),
        ANGLE,
    ),
    "joint_error": Block(
        "joint angles of the rigid arm on the reference, with its elbow on the side of `elbow_branch`, minus the "
        "measured ones, within half a turn",
        "rad",
        "2",
        _rows("F_JOINT_ERROR"),
        lambda s, r: even_range(2, 0.3, np.pi + 1e-9),
        ANGLE,
    ),
    "joint_error_rate": Block(
        "joint rates of that arm minus the measured ones",
        "rad/s",
        "2",
        _rows("F_JOINT_ERROR_RATE"),
        lambda s, r: even_range(2, 3.0, joint_rate_bound(s, r)),
        ANGLE,
    ),
    "present_joint_error": Block(
        "as `joint_error`, with the rigid arm's elbow on the side on which the measured elbow is",
        "rad",
        "2",
        _rows("F_PRESENT_JOINT_ERROR"),
        lambda s, r: even_range(2, 0.3, np.pi + 1e-9),
        ANGLE,
    ),
    "present_joint_error_rate": Block(
        "as `joint_error_rate`, for that arm",
        "rad/s",
        "2",
        _rows("F_PRESENT_JOINT_ERROR_RATE"),
        lambda s, r: even_range(2, 3.0, joint_rate_bound(s, r)),
        ANGLE,
    ),
    "encoder_error": Block(
        "reference minus the tip by rigid kinematics of the measured angles",
        "m",
        "2",
        _rows("F_ENCODER_ERROR"),
        lambda s, r: even_range(2, 0.5, r.radius + s.flexible_arm.parameters.reach),
        VECTOR,
    ),
    "sensed_position": Block(
        "latest reading of the sensor on link 2: late, noisy",
        "m",
        "2",
        _rows("F_LINK_SENSOR"),
        lambda s, r: even_range(2, 6.3, r.sensed * 2**0.5),
        VECTOR,
    ),
    "sensor_error": Block(
        "reference at the time of that reading minus the reading",
        "m",
        "2",
        _rows("F_SENSOR_ERROR"),
        lambda s, r: even_range(2, 0.5, r.error * 2**0.5),
        VECTOR,
    ),
    "sensor_error_rate": Block(
        "change of `sensor_error` since the reading before, per second",
        "m/s",
        "2",
        _rows("F_SENSOR_ERROR_RATE"),
        lambda s, r: even_range(2, 3.0, 2.0 * r.error * 2**0.5 / (0.499 * s.control_period)),
        VECTOR,
    ),
    "second_sensed_position": Block(
        "latest reading of the second sensor (`second_sensor_link`): late, noisy",
        "m",
        "2",
        _rows("F_SECOND_SENSED"),
        lambda s, r: even_range(2, 6.3, r.second * 2**0.5),
        VECTOR,
    ),
    "second_sensor_error": Block(
        "the same point of the rigid arm on the reference at the time of that reading, minus the reading",
        "m",
        "2",
        _rows("F_SECOND_ERROR"),
        lambda s, r: even_range(2, 0.5, r.second_error * 2**0.5),
        VECTOR,
    ),
    "modal_coordinates": Block(
        "of link 1, of link 2, from strain gauges",
        "1",
        "2 m",
        lambda s: ("STATE", 2, 2 * _modes(s)),
        lambda s, r: modal_range(s, rates=False),
        ANGLE,
    ),
    "modal_rates": Block(
        "rates of the modal coordinates",
        "1/s",
        "2 m",
        lambda s: ("STATE", 4 + 2 * _modes(s), 2 * _modes(s)),
        lambda s, r: modal_range(s, rates=True),
        ANGLE,
    ),
    "reference_position": Block(
        "where the tip should be",
        "m",
        "2",
        _rows("F_REFERENCE"),
        lambda s, r: even_range(2, 6.3, r.radius + 1e-9),
        VECTOR,
    ),
    "reference_velocity": Block(
        "its velocity; at a corner that of the side that begins",
        "m/s",
        "2",
        _rows("F_REFERENCE_VELOCITY"),
        lambda s, r: even_range(2, 3.15, r.speed * (1.0 + 1e-9)),
        VECTOR,
    ),
    "previews": Block(
        "how far the reference will have moved at each horizon: x and y of the first, of the second, ...",
        "m",
        "2 per horizon",
        lambda s: ("TAIL", 0, 2 * len(s.previews)),
        lambda s, r: even_range(2 * len(s.previews), 2.0, 2.0 * r.radius + 1e-9),
        VECTOR,
    ),
    "last_actions": Block(
        "the last actions, limited to [-1, 1], the newest first",
        "1",
        "action size per action",
        lambda s: ("TAIL", 2 * len(s.previews), s.last_actions * len(s.action_limit)),
        lambda s, r: even_range(s.last_actions * len(s.action_limit), 1.0, 1.0),
        None,
    ),
    "torque": Block(
        "commanded torque of the motors, which `actuation_delay` makes act later; what the next action changes",
        "N m",
        "2",
        lambda s: ("TAIL", 2 * len(s.previews) + s.kept_actions * len(s.action_limit), 2),
        lambda s, r: Range(list(s.motor_limit), list(s.motor_limit)),
        ANGLE,
        tuple(name for name, mode in MODES.items() if mode.accumulates),
    ),
    "lap_phase": Block(
        "cosine and sine of the share of the lap that is done, as an angle",
        "1",
        "2",
        _rows("F_PHASE"),
        lambda s, r: even_range(2, 1.0, 1.0 + 1e-9),
        SCALAR,
    ),
    "inner_gain": Block(
        'lambda of the period that ended (0 unless `action_mode` is "gain")',
        "1",
        "1",
        _rows("EFFECTIVE_GAIN", 0, 1),
        lambda s, r: even_range(1, s.gain_limit, s.gain_limit),
        SCALAR,
    ),
}


def shape_of(settings: Settings, program: Program) -> Shape:
    """Return the shape on which the tables of an environment's kernels depend."""
    foreshortened = settings.flexible_arm.constants.foreshortened
    return Shape(program, _modes(settings), foreshortened, settings.second_sensor is not None)


class ObservationLayout(NamedTuple):
    """Layout of an observation.

    Attributes:
        blocks: slice of each block.
        rows: row of the arena of each number. Shape (k,).
        scale: divisor of each number. Shape (k,).
        bound: largest magnitude of each number. Shape (k,), float32.
        mirror: sign of each number in the mirrored episode. Shape (k,), float32.
    """

    blocks: dict[str, slice]
    rows: NDArray[np.int64]
    scale: Array
    bound: NDArray[np.float32]
    mirror: NDArray[np.float32]


def common_layout(kinds: Sequence[Settings], program: Program) -> ObservationLayout:
    """Lay out the observations of a batch (`observation_layout`), with the widest bounds of its environments.

    Args:
        kinds: distinct settings of the environments.
        program: program of the kernels.
    """
    layouts = [observation_layout(settings, program) for settings in kinds]
    assert all(np.array_equal(one.scale, layouts[0].scale) for one in layouts)
    return layouts[0]._replace(bound=np.max([one.bound for one in layouts], axis=0))


def observation_layout(settings: Settings, program: Program) -> ObservationLayout:
    """Lay out the observation that an environment's settings select.

    Args:
        settings: settings of the environment.
        program: program of the kernels.

    Raises:
        ValueError: for an unknown block, or one that the action mode does not have.
    """
    places = Row.layout(shape_of(settings, program))
    reach = reach_of(settings)
    blocks: dict[str, slice] = {}
    rows: list[int] = []
    scale: list[float] = []
    bound: list[float] = []
    mirror: list[int] = []
    for name in settings.observation:
        block = BLOCKS[choice("observation", name, BLOCKS)]
        if settings.action_mode not in block.modes:
            raise ValueError(
                f"observation: there is no block {name!r} with action_mode = {settings.action_mode!r}; "
                f"only with {' or '.join(map(repr, block.modes))}"
            )
        part, first, count = block.rows(settings)
        limits = block.limits(settings, reach)
        blocks[name] = slice(len(rows), len(rows) + count)
        rows += range(places[part][0] + first, places[part][0] + first + count)
        scale += limits.scale if settings.scaled else [1.0] * count
        bound += limits.bound
        mirror += np.resize(block.mirror or (settings.mode.mirror,), count).tolist()
    scales = np.array(scale)
    # rounded outwards, so that the float32 of a value at the bound is inside
    limit = np.nextafter((np.array(bound) / scales).astype(np.float32), np.float32(np.inf))
    signs = np.array(mirror, dtype=np.float32)
    return ObservationLayout(blocks, np.array(rows, dtype=np.int64), scales, limit, signs)
