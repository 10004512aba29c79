"""Where the arm's points are and what a sensor reads of them, as plain functions of numbers (see `dynamics`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from flexarm_env.codegen.elementary import sincos
from flexarm_env.physics.bent_link import PointShape, bent
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.dynamics import joint_angles, public_coordinates
from flexarm_env.physics.linear_algebra import dot

Pair = Sequence[Any]


def rigid_point(distance_1: Any, distance_2: Any, one: Pair, both: Pair) -> tuple[Any, Any]:
    """Rigid kinematics (8), (9); `one`, `both`: sine and cosine of theta1 and of theta1 + theta2."""
    return distance_1 * one[1] + distance_2 * both[1], distance_1 * one[0] + distance_2 * both[0]


def rigid_jacobian(distance_1: Any, distance_2: Any, one: Pair, both: Pair) -> tuple[Pair, Pair]:
    """J (13), by columns: of the shoulder and of the elbow. Row 2, column 1 has the cosine that (13) misprints."""
    x, y = rigid_point(distance_1, distance_2, one, both)
    return (-y, x), (-(distance_2 * both[0]), distance_2 * both[1])


def true_point(k: Constants, at: PointShape, y: Sequence[Any], one: Pair, two: Pair) -> tuple[Any, Any]:
    """A point of link 2 with deflection; `one`, `two`: sine and cosine of a1 and of a2."""
    m = len(k.elbow_values)
    elbow, point = bent(k.elbow, y[1 : m + 1]), bent(at, y[m + 2 :])
    return (
        elbow.along * one[1] - elbow.across * one[0] + point.along * two[1] - point.across * two[0],
        elbow.along * one[0] + elbow.across * one[1] + point.along * two[0] + point.across * two[1],
    )


def true_jacobian(k: Constants, at: PointShape, y: Sequence[Any], one: Pair, two: Pair) -> tuple[list[Any], list[Any]]:
    """Rows of d(true point)/dy."""
    m = len(k.elbow_values)
    row_x, row_y = [], []
    for part, (sin, cos) in ((bent(k.elbow, y[1 : m + 1]), one), (bent(at, y[m + 2 :]), two)):
        modes = list(zip(part.values, part.foreshortening_gradient, strict=True))
        row_x += [
            -(part.along * sin + part.across * cos),
            *(-(value * sin + foreshortening_gradient * cos) for value, foreshortening_gradient in modes),
        ]
        row_y += [
            part.along * cos - part.across * sin,
            *(value * cos - foreshortening_gradient * sin for value, foreshortening_gradient in modes),
        ]
    return row_x, row_y


def reading(k: Constants, at: PointShape, sensor: str, y: Sequence[Any], v: Sequence[Any]) -> list[Any]:
    """What a sensor measures at this instant: two readings and their rates."""
    if sensor != "true":
        return [*joint_angles(k, y), *joint_angles(k, v)]
    one, two = sincos(y[0]), sincos(y[len(k.elbow_values) + 1])
    rows = true_jacobian(k, at, y, one, two)
    return [*true_point(k, at, y, one, two), dot(rows[0], v), dot(rows[1], v)]


class Truth(NamedTuple):
    """The arm at an instant; each a list of numbers.

    Attributes:
        state: public state.
        true_tip: with deflection [m].
        rigid_tip: by rigid kinematics (8), (9) [m].
        deflection: of each link's tip [m].
        deflection_rate: [m/s].
    """

    state: list[Any]
    true_tip: Sequence[Any]
    rigid_tip: Sequence[Any]
    deflection: list[Any]
    deflection_rate: list[Any]


def truth(k: Constants, tip: PointShape, y: Sequence[Any], v: Sequence[Any]) -> Truth:
    """Public state, tips and deflections.

    Args:
        k: constants of the arm.
        tip: of link 2.
        y: internal coordinates.
        v: internal rates.
    """
    m = len(k.elbow_values)
    theta1, theta2 = joint_angles(k, y)
    one, two = sincos(y[0]), sincos(y[m + 1])
    state = [*public_coordinates(k, y), *public_coordinates(k, v)]
    rigid_tip = rigid_point(k.elbow_distance, tip.distance, one, sincos(theta1 + theta2))
    bends = [[dot(k.elbow_values, x[1 : m + 1]), dot(tip.values, x[m + 2 :])] for x in (y, v)]
    return Truth(state, true_point(k, tip, y, one, two), rigid_tip, *bends)
