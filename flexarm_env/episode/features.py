"""Parts of observations, as plain functions of numbers that a controller can measure (see `dynamics`); their kernels.

Cartesian quantities are given in a *frame*: the world's, or the link's, turned by the measured -theta1. The plant has
no preferred direction, so in the link's frame the four sides of a square look alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from flexarm_env.codegen.arrays import Arena, Table
from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.tracing import floor, root
from flexarm_env.episode import reward
from flexarm_env.kernels.recorder import Recorder, recorded_kernel
from flexarm_env.physics.inverse_kinematics import TURN, joint_angles_for, joint_rates_for


class Measurements(NamedTuple):
    """Measurements and reference at an instant; lists of numbers.

    Attributes:
        encoders: joint angles [rad] and rates [rad/s] by the encoders.
        reference: position [m] and velocity [m/s].
        reference_joints: joint angles and rates of the rigid arm on the reference.
        link_sensor: latest reading of the sensor [m].
        sensor_error: reference at the time of that reading minus the reading [m].
        sensor_error_rate: its change since the reading before, per second [m/s].
        lengths: lengths of the links [m].
        phase: phase of the lap, 0 to 1.
        frame: 1 for the link's frame, 0 for the world's.
    """

    encoders: Sequence[Any]
    reference: Sequence[Any]
    reference_joints: Sequence[Any]
    link_sensor: Sequence[Any]
    sensor_error: Sequence[Any]
    sensor_error_rate: Sequence[Any]
    lengths: Sequence[Any]
    phase: Any
    frame: Any


class Features(NamedTuple):
    """Parts of observations; lists of numbers in SI units. `frame_axis`: cosine and sine of the frame's angle."""

    directions: list[Any]
    joint_error: list[Any]
    joint_error_rate: list[Any]
    encoder_error: list[Any]
    reference: list[Any]
    reference_velocity: list[Any]
    link_sensor: list[Any]
    sensor_error: list[Any]
    sensor_error_rate: list[Any]
    phase: list[Any]
    frame_axis: list[Any]


def features(measured: Measurements) -> Features:
    """Compute all parts of observations from the measurements."""
    theta1, theta2 = measured.encoders[:2]
    one, two = sincos(theta1), sincos(theta2)
    both = (one[0] * two[1] + one[1] * two[0], one[1] * two[1] - one[0] * two[0])
    axis = [measured.frame * one[1] + (1.0 - measured.frame), measured.frame * one[0]]
    tip = [measured.lengths[0] * one[n] + measured.lengths[1] * both[n] for n in (1, 0)]
    error, error_rate = joint_errors(measured.reference_joints, measured.encoders)
    lap = sincos(TURN * measured.phase)
    return Features(
        directions=[two[1], two[0], one[1], one[0]],
        joint_error=error,
        joint_error_rate=error_rate,
        encoder_error=in_frame(axis, [measured.reference[r] - tip[r] for r in (0, 1)]),
        reference=in_frame(axis, measured.reference[:2]),
        reference_velocity=in_frame(axis, measured.reference[2:]),
        link_sensor=in_frame(axis, measured.link_sensor),
        sensor_error=in_frame(axis, measured.sensor_error),
        sensor_error_rate=in_frame(axis, measured.sensor_error_rate),
        phase=[lap[1], lap[0]],
        frame_axis=axis,
    )


def joint_errors(aim: Sequence[Any], encoders: Sequence[Any]) -> tuple[list[Any], list[Any]]:
    """Subtract the measured joint angles and rates from the desired ones; angles are within half a turn."""
    angles = [_turned_back(a - b) for a, b in zip(aim[:2], encoders[:2], strict=True)]
    return angles, [a - b for a, b in zip(aim[2:], encoders[2:], strict=True)]


def in_frame(axis: Sequence[Any], vector: Sequence[Any]) -> list[Any]:
    """Return a vector's components along the frame's axes."""
    return [axis[0] * vector[0] + axis[1] * vector[1], axis[0] * vector[1] - axis[1] * vector[0]]


def joint_aim(lengths: Sequence[Any], branch: Any, reference: Sequence[Any], near: Any) -> list[Any]:
    """Return joint angles and rates of the rigid arm on the reference; theta1 within half a turn of `near` [rad]."""
    theta1, theta2 = joint_angles_for(lengths[0], lengths[1], branch, reference[0], reference[1])
    rates = joint_rates_for(lengths[0], lengths[1], theta1, theta2, reference[2], reference[3])
    whole_turns = floor((near - theta1) * (1.0 / TURN) + 0.5)  # repeating it with the result gives the same bits
    return [theta1 + TURN * whole_turns, theta2, *rates]


def _turned_back(angle: Any) -> Any:
    """Return the same direction as an angle within half a turn of 0."""
    return angle - TURN * floor(angle * (1.0 / TURN) + 0.5)


# --- recorded ---------------------------------------------------------------------------------------------------------


@recorded_kernel
def features_kernel(r: Recorder, arena: Arena, length_1: float, length_2: float, weights: Table) -> None:
    """Compute each lane's parts of observations and terms of the reward.

    Args:
        r: records it.
        arena: of one block.
        length_1: length of link 1 [m].
        length_2: length of link 2 [m].
        weights: weight of each term.
    """
    names = ("encoders", "reference", "reference_joints", "link_sensor", "sensor_error", "sensor_error_rate")
    measured = Measurements(
        **{name: r.read(name.upper()) for name in names},
        lengths=(length_1, length_2),
        phase=r.one("PHASE"),
        frame=r.one("LINK_FRAME"),
    )
    found = features(measured)
    for name, values in found._asdict().items():
        r.write(("" if name == "frame_axis" else "F_") + name.upper(), values)
    errors, error_rates = joint_errors(r.read("PRESENT_JOINT"), measured.encoders)
    r.write("F_PRESENT_JOINT_ERROR", errors)
    r.write("F_PRESENT_JOINT_ERROR_RATE", error_rates)
    for name in ("FURTHER_READING", "FURTHER_ERROR") if r.variant.further_points else ():
        points = [r.read(name)[2 * n : 2 * n + 2] for n in range(r.variant.further_points)]
        r.write(f"F_{name}", [x for point in points for x in in_frame(found.frame_axis, point)])
    square = reward.squared_distance(r.read("TRUE_TIP"), r.read("REFERENCE"))
    r.write("TIP_ERROR", [root(square)])
    terms = reward.tracking_terms(square)
    terms += reward.regularising_terms(r.one("ACTION_CHANGE"), r.read("TORQUE"), r.read("DEFLECTION_RATE"))
    if r.variant.racing:
        terms.append(reward.progress_term(r.one("REFERENCE_SPEED"), r.read("PACE")[0]))
    weighted = [r.trace.number("weights", n) * term for n, term in enumerate(terms)]
    r.write("REWARD_TERMS", weighted)
    total = weighted[0]
    for term in weighted[1:]:
        total = total + term
    r.write("REWARD", [total])


@recorded_kernel
def joint_kernel(r: Recorder, arena: Arena, length_1: float, length_2: float) -> None:
    """Compute each lane's joint angles and rates of the rigid arm on the reference."""
    r.write(
        "REFERENCE_JOINTS",
        joint_aim((length_1, length_2), r.one("BRANCH"), r.read("REFERENCE"), r.read("REFERENCE_JOINTS")[0]),
    )
