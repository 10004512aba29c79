"""Where the arm's points are and what a sensor reads of them, as plain functions of numbers (see `dynamics`)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from flexarm_env.codegen.elementary import sincos
from flexarm_env.parameters import SENSOR_MODELS, SensorModel
from flexarm_env.physics.bent_link import DeformedPoint, PointShape, bent, velocity_acceleration
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.dynamics import elbow_turn, joint_angles, public_coordinates
from flexarm_env.physics.linear_algebra import Vector, dot

Pair = Sequence[Any]


def rigid_point(distance_1: Any, distance_2: Any, one: Pair, both: Pair) -> tuple[Any, Any]:
    """Apply rigid kinematics (8), (9); `one`, `both`: sine and cosine of theta1 and of theta1 + theta2."""
    return distance_1 * one[1] + distance_2 * both[1], distance_1 * one[0] + distance_2 * both[0]


def rigid_jacobian(distance_1: Any, distance_2: Any, one: Pair, both: Pair) -> tuple[Pair, Pair]:
    """Return J (13), by columns: shoulder and elbow. Row 2, column 1 has the cosine that (13) misprints."""
    x, y = rigid_point(distance_1, distance_2, one, both)
    return (-y, x), (-(distance_2 * both[0]), distance_2 * both[1])


def true_point(k: Constants, at: PointShape, y: Sequence[Any], one: Pair, two: Pair) -> tuple[Any, Any]:
    """Return a point of link 2 with deflection; `one`, `two`: sine and cosine of a1 and of a2."""
    m = len(k.elbow_values)
    elbow, point = bent(k.elbow, y[1 : m + 1]), bent(at, y[m + 2 :])
    return (
        elbow.along * one[1] - elbow.across * one[0] + point.along * two[1] - point.across * two[0],
        elbow.along * one[0] + elbow.across * one[1] + point.along * two[0] + point.across * two[1],
    )


def true_jacobian(k: Constants, at: PointShape, y: Sequence[Any], one: Pair, two: Pair) -> tuple[list[Any], list[Any]]:
    """Return the rows of d(true point)/dy."""
    m = len(k.elbow_values)
    row_x, row_y = [], []
    for part, turn in ((bent(k.elbow, y[1 : m + 1]), one), (bent(at, y[m + 2 :]), two)):
        of_part = _turned_jacobian(part, turn)
        row_x += of_part[0]
        row_y += of_part[1]
    return row_x, row_y


def _turned_jacobian(part: DeformedPoint, turn: Pair) -> tuple[list[Any], list[Any]]:
    """Return the derivatives of a bent link's point by the link's angle and modal coordinates: rows for x and y."""
    sin, cos = turn
    modes = list(zip(part.values, part.foreshortening_gradient, strict=True))
    return (
        [
            -(part.along * sin + part.across * cos),
            *(-(value * sin + foreshortening_gradient * cos) for value, foreshortening_gradient in modes),
        ],
        [
            part.along * cos - part.across * sin,
            *(value * cos - foreshortening_gradient * sin for value, foreshortening_gradient in modes),
        ],
    )


def angles_reading(k: Constants, at: PointShape, y: Sequence[Any], v: Sequence[Any]) -> list[Any]:
    """Return the joint angles and their rates, wherever the sensor is."""
    return [*joint_angles(k, y), *joint_angles(k, v)]


def point_reading(k: Constants, at: PointShape, y: Sequence[Any], v: Sequence[Any], link: int = 2) -> list[Any]:
    """Return x, y [m] and their rates [m/s] of a point of a link, 1 or 2, with deflection."""
    m = len(k.elbow_values)
    one = sincos(y[0])
    if link == 1:
        (sin, cos), point = one, bent(at, y[1 : m + 1])
        rows = _turned_jacobian(point, one)
        position = (point.along * cos - point.across * sin, point.along * sin + point.across * cos)
        return [*position, dot(rows[0], v[: m + 1]), dot(rows[1], v[: m + 1])]
    two = sincos(y[m + 1])
    rows = true_jacobian(k, at, y, one, two)
    return [*true_point(k, at, y, one, two), dot(rows[0], v), dot(rows[1], v)]


class Mount(NamedTuple):
    """Where a sensor is.

    Attributes:
        link: 1 or 2.
        point: of the link.
        slopes: of the link's mode shapes there [1].
    """

    link: int
    point: PointShape
    slopes: Vector


class Motion(NamedTuple):
    """How the arm moves at an instant.

    Attributes:
        y: internal coordinates.
        v: their rates.
        acceleration: rates of `v`; empty for sensors that do not need it.
    """

    y: Sequence[Any]
    v: Sequence[Any]
    acceleration: Sequence[Any]


class Quantity(NamedTuple):
    """What a sensor at a point of a link measures.

    Attributes:
        formula: returns a reading at an instant; of a position with its rates, which follow it.
        size: how many numbers a reading has, without rates.
        accelerated: whether the formula needs the acceleration.
    """

    formula: Callable[[Constants, Mount, Motion], list[Any]]
    size: int
    accelerated: bool = False


def position(k: Constants, mount: Mount, motion: Motion) -> list[Any]:
    """Return position and velocity of the sensor's point."""
    return point_reading(k, mount.point, motion.y, motion.v, mount.link)


def inertial(k: Constants, mount: Mount, motion: Motion) -> list[Any]:
    """Return what an inertial measurement unit (IMU) on the link's axis measures.

    Its accelerometer measures the specific force, which is acceleration less gravity (Titterton & Weston, *Strapdown
    inertial navigation technology*, 2nd ed. 2004, section 2.2). Gravity is at right angles to the arm's plane, so that
    these two components are those of the acceleration alone.

    Returns:
        Specific force along and across the link's tangent at the point [m/s^2], and the tangent's rate [rad/s].
    """
    m = len(k.elbow_values)
    one, two = ([part[: m + 1] for part in motion], [part[m + 1 :] for part in motion])
    if mount.link == 1:
        (q, rates), force = one[:2], _acceleration_along(mount.point, *one)
    else:
        carried = _turned(_acceleration_along(k.elbow, *one), sincos(elbow_turn(motion.y)))
        own = _acceleration_along(mount.point, *two)
        (q, rates), force = two[:2], [a + b for a, b in zip(carried, own, strict=True)]
    return [*_turned(force, sincos(dot(mount.slopes, q[1:]))), dot(mount.slopes, rates[1:], rates[0])]


def _acceleration_along(at: PointShape, y: Sequence[Any], v: Sequence[Any], acceleration: Sequence[Any]) -> list[Any]:
    """Return the acceleration of a link's point along and across the root tangent, while the root does not move."""
    point = bent(at, y[1:])
    towards, back = velocity_acceleration(at, point, v[1:], v[0])
    drawn = dot(point.foreshortening_gradient, acceleration[1:], acceleration[0] * point.across)
    return [-drawn - towards, dot(point.values, acceleration[1:], acceleration[0] * point.along) - back]


def _turned(vector: Sequence[Any], angle: Pair) -> list[Any]:
    """Return a vector's components along axes that are turned; `angle`: sine and cosine of their angle."""
    (along, across), (sin, cos) = vector, angle
    return [cos * along + sin * across, cos * across - sin * along]


POSITION = "position"  # the quantity whose rates follow it, and which the reference has, too
QUANTITIES_AT_A_POINT = {  # by name
    POSITION: Quantity(position, 2),
    "inertial": Quantity(inertial, 3, accelerated=True),
}
READINGS = {"angles": angles_reading, "point": point_reading}  # of sensors (`parameters.SensorTraits`)


def reading(k: Constants, at: PointShape, sensor: SensorModel, y: Sequence[Any], v: Sequence[Any]) -> list[Any]:
    """Return what a sensor measures at this instant: two readings and their rates."""
    return READINGS[SENSOR_MODELS[sensor].reading](k, at, y, v)


class Truth(NamedTuple):
    """The arm at an instant; each a list of numbers.

    Attributes:
        state: public state.
        true_tip: with deflection [m].
        rigid_tip: by rigid kinematics (8), (9) [m].
        deflection: of each link's tip off its root tangent [m].
        deflection_rate: [m/s].
    """

    state: list[Any]
    true_tip: Sequence[Any]
    rigid_tip: Sequence[Any]
    deflection: list[Any]
    deflection_rate: list[Any]


def truth(k: Constants, tip: PointShape, y: Sequence[Any], v: Sequence[Any]) -> Truth:
    """Return public state, tips and deflections of an arm; `tip`: that of link 2."""
    m = len(k.elbow_values)
    theta1, theta2 = joint_angles(k, y)
    one, two = sincos(y[0]), sincos(y[m + 1])
    state = [*public_coordinates(k, y), *public_coordinates(k, v)]
    rigid_tip = rigid_point(k.elbow_distance, tip.distance, one, sincos(theta1 + theta2))
    bends = [[dot(k.elbow_values, x[1 : m + 1]), dot(tip.values, x[m + 2 :])] for x in (y, v)]
    return Truth(state, true_point(k, tip, y, one, two), rigid_tip, *bends)


class Outputs(NamedTuple):
    """Outputs of an arm, or their derivatives by its state.

    Attributes:
        joints: theta1, theta2 [rad] and their rates [rad/s], what encoders read. Shape (..., 4).
        sensed: position of the sensor's point [m] and its velocity [m/s]. Shape (..., 4).
        true_tip: with deflection [m]. Shape (..., 2).
        rigid_tip: by rigid kinematics of the joint angles (8), (9) [m]. Shape (..., 2).
        deflection: deflection of each link's tip off its root tangent [m]. Shape (..., 2).
        deflection_rate: [m/s]. Shape (..., 2).
    """

    joints: Any
    sensed: Any
    true_tip: Any
    rigid_tip: Any
    deflection: Any
    deflection_rate: Any


OUTPUT_SIZES = Outputs(4, 4, 2, 2, 2, 2)


def outputs(k: Constants, tip: PointShape, sensor: PointShape, y: Sequence[Any], v: Sequence[Any]) -> Outputs:
    """Return what sensors read of the arm and where its tips are; `sensor`: its point of link 2, `tip`: link 2's."""
    _, *known = truth(k, tip, y, v)
    return Outputs(angles_reading(k, sensor, y, v), point_reading(k, sensor, y, v), *known)
