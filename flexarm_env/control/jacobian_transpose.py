"""One implicit stage of the arm under the inner law, as plain functions of numbers (see `dynamics`).

The law (10), (14) acts in continuous time inside the integrator. Its rate feedback is very stiff: without hub
inertia a joint's effective inertia at high frequency is small and shrinks with every mode, while the feedback
reaches Kd (L1 + L2)^2 = 1400 N m s/rad. The fastest closed-loop pole is near -11 000 /s with one mode a link and
-271 000 /s with four, times lambda. So each stage solves for the velocity with the law's torque taken at the end of
the stage. The torque is linear in the velocity and acts through two joints: that takes one elimination or factorisation
of M and a 2 x 2 system, whatever the number of modes.

Symbols:
    reading: what the sensor measures: the joint angles or the Cartesian point (`parameters.SENSOR_MODELS`).
        Late readings arrive as ``offset + weight * current``: weight 0 for a reading from the past, weight 1 and
        offset 0 without delay, in between for a delay shorter than the stage (interpolated within the step).
    command: reference position and velocity, for each joint's torque its own (its delay may differ).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from flexarm_env.codegen.elementary import sincos
from flexarm_env.codegen.tracing import at_least, clip
from flexarm_env.parameters import SENSOR_MODELS, SensorModel
from flexarm_env.physics.bent_link import PointShape
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.dynamics import (
    applied_forces,
    elbow_turn,
    generalised_torque,
    inertia,
    joint_angles,
    rigid_velocity_forces,
    solve,
    velocity_forces,
)
from flexarm_env.physics.linear_algebra import dot
from flexarm_env.physics.modal_elimination import Elimination
from flexarm_env.physics.sensing import Pair, rigid_jacobian, rigid_point, true_jacobian, true_point

SMALL = 1e-9  # a divisor that pushes a torque to its limit


class Law(NamedTuple):
    """What the law needs in one stage; each field a number, or a tuple of numbers.

    Attributes:
        gain: lambda (14).
        proportional_gain: Kp (11) [N/m].
        derivative_gain: Kd (12) [N s/m].
        torque_limit: of shoulder and elbow [N m].
        sensor_distance: of the sensor from the elbow [m].
        sensor_values: phi_i at the sensor (link 2), used where the sensor sees the deflection.
        sensor_foreshortening: S there, lower triangle; empty with linear kinematics.
        noise: added to the reading's Cartesian position [m].
        command_1: reference position and velocity (x, y, x', y') in the shoulder's torque.
        command_2: the same in the elbow's.
        offset: late part of the two readings.
        weight: share of the current two readings.
        rate_offset: late part of the two readings' rates.
        rate_weight: share of the current rates.
    """

    gain: Any
    proportional_gain: Any
    derivative_gain: Any
    torque_limit: Pair
    sensor_distance: Any
    sensor_values: Sequence[Any]
    sensor_foreshortening: Sequence[Any]
    noise: Pair
    command_1: Sequence[Any]
    command_2: Sequence[Any]
    offset: Pair
    weight: Pair
    rate_offset: Pair
    rate_weight: Pair

    @property
    def place(self) -> PointShape:
        """Where the sensor is."""
        return PointShape(self.sensor_distance, self.sensor_values, self.sensor_foreshortening)

    @staticmethod
    def sizes(modes: int, foreshortened: bool = False) -> dict[str, int]:
        """Return how many numbers each field holds."""
        return {
            "gain": 1,
            "proportional_gain": 1,
            "derivative_gain": 1,
            "torque_limit": 2,
            "sensor_distance": 1,
            "sensor_values": modes,
            "sensor_foreshortening": foreshortened * modes * (modes + 1) // 2,
            "noise": 2,
            "command_1": 4,
            "command_2": 4,
            "offset": 2,
            "weight": 2,
            "rate_offset": 2,
            "rate_weight": 2,
        }


def _late(current: Pair, law: Law) -> list[Any]:
    return [law.offset[j] + law.weight[j] * current[j] for j in (0, 1)]


class Measurement(NamedTuple):
    """The measured point in one stage of the law.

    Attributes:
        point: x, y, late as the sensor is.
        late_rate: the part of the point's rate that comes from the past.
        rate_rows: rows G; the point's rate is ``late_rate + G v``.
    """

    point: Pair
    late_rate: Pair
    rate_rows: Sequence[Sequence[Any]]


def _point_measurement(
    k: Constants, law: Law, y: Sequence[Any], current_jacobian: tuple[Pair, Pair] | None
) -> Measurement:
    """Measure the physical point, with one delay for the whole reading, and the rates by the point's own Jacobian."""
    one, two = sincos(y[0]), sincos(y[len(k.elbow_values) + 1])
    rows = true_jacobian(k, law.place, y, one, two)
    weighted = [[law.rate_weight[r] * value for value in rows[r]] for r in (0, 1)]
    return Measurement(_late(true_point(k, law.place, y, one, two), law), law.rate_offset, weighted)


def _angles_measurement(
    k: Constants, law: Law, y: Sequence[Any], current_jacobian: tuple[Pair, Pair] | None
) -> Measurement:
    """Measure by rigid kinematics of the joint angles, each with its own delay."""
    theta1, theta2 = _late(joint_angles(k, y), law)
    one, both = sincos(theta1), sincos(theta1 + theta2)
    point = rigid_point(k.elbow_distance, law.sensor_distance, one, both)
    columns = current_jacobian or rigid_jacobian(k.elbow_distance, law.sensor_distance, one, both)
    # the joint rates are the transpose of the torques' action, B^T v
    joints = [generalised_torque(k, unit) for unit in ((1.0, 0.0), (0.0, 1.0))]
    late = [columns[0][r] * law.rate_offset[0] + columns[1][r] * law.rate_offset[1] for r in (0, 1)]
    weighted = [[columns[j][r] * law.rate_weight[j] for j in (0, 1)] for r in (0, 1)]
    rows = [[weighted[r][0] * a + weighted[r][1] * b for a, b in zip(*joints, strict=True)] for r in (0, 1)]
    return Measurement(point, late, rows)


MEASUREMENTS = {"angles": _angles_measurement, "point": _point_measurement}  # by what a reading holds


class Stage(NamedTuple):
    """Result of one implicit stage.

    Attributes:
        v: internal rates.
        mechanical: acceleration M^-1 (-h - K y - D v) at v.
        feedback: acceleration M^-1 B tau by the law.
        tau: torques [N m].
    """

    v: list[Any]
    mechanical: list[Any]
    feedback: list[Any]
    tau: list[Any]


def law_stage(
    k: Constants,
    e: Elimination | None,
    law: Law,
    variant: tuple[bool, SensorModel, str],
    y: Sequence[Any],
    v_known: Sequence[Any],
    h_gamma: Any,
) -> Stage:
    """Solve one stage ``v = v_known + h gamma M^-1 B tau(v)`` for v.

    Args:
        k: constants of the arm.
        e: see `dynamics.inertia`.
        law: the law's data in this stage.
        variant: whether velocity forces are complete; the sensor's model; which Jacobian maps the measured joint rates,
            "delayed" (at the late angles) or "current".
        y: internal coordinates of the stage (explicit).
        v_known: explicit part of its rates.
        h_gamma: step times the diagonal coefficient [s].
    """
    complete, sensor, rate_jacobian = variant
    m = len(k.elbow_values)
    sin, cos = sincos(elbow_turn(y))
    one, both = sincos(y[0]), sincos(y[m + 1] - dot(k.elbow_slopes, y[1 : m + 1]))  # theta1, theta1 + theta2
    jacobian = rigid_jacobian(k.elbow_distance, law.sensor_distance, one, both)
    measure = MEASUREMENTS[SENSOR_MODELS[sensor].reading]
    measured = measure(k, law, y, jacobian if rate_jacobian == "current" else None)
    at = inertia(k, e, y, cos, sin)
    responses = [solve(k, e, at, generalised_torque(k, unit)) for unit in ((1.0, 0.0), (0.0, 1.0))]
    tau = _torque(law, jacobian, measured, v_known, responses, h_gamma)
    feedback = [a * tau[0] + b * tau[1] for a, b in zip(*responses, strict=True)]
    v = [known + h_gamma * acceleration for known, acceleration in zip(v_known, feedback, strict=True)]
    sin_theta2 = both[0] * one[1] - both[1] * one[0]
    h = velocity_forces(k, y, v, cos, sin) if complete else rigid_velocity_forces(k, v, sin_theta2)
    return Stage(v, solve(k, e, at, applied_forces(k, y, v, h)), feedback, tau)


def _torque(
    law: Law,
    jacobian: tuple[Pair, Pair],
    measured: Measurement,
    v_known: Sequence[Any],
    responses: Sequence[Sequence[Any]],
    h_gamma: Any,
) -> list[Any]:
    """Compute the law's torque (14) at the end of the stage, from the rates' known part."""
    known_rate = [measured.late_rate[r] + dot(measured.rate_rows[r], v_known) for r in (0, 1)]
    response = [[dot(measured.rate_rows[r], responses[j]) for j in (0, 1)] for r in (0, 1)]
    damping = h_gamma * law.gain * law.derivative_gain
    commands = (law.command_1, law.command_2)
    wanted, feedback = [], []
    for j in (0, 1):  # (10), row by row: the two joints may be commanded with different delays
        force = [
            law.proportional_gain * (commands[j][r] - (measured.point[r] + law.noise[r]))
            + law.derivative_gain * (commands[j][2 + r] - known_rate[r])
            for r in (0, 1)
        ]
        wanted.append(law.gain * (jacobian[j][0] * force[0] + jacobian[j][1] * force[1]))
        feedback.append([damping * (jacobian[j][0] * response[0][i] + jacobian[j][1] * response[1][i]) for i in (0, 1)])
    return _limited_solution(wanted, feedback, law.torque_limit)


def _limited_solution(wanted: Pair, feedback: Sequence[Pair], limit: Pair) -> list[Any]:
    """Return tau = clip(wanted - feedback tau), limited joint by joint.

    The free solution, then one Gauss-Seidel sweep over the limited problem. While the diagonal of 1 + feedback and
    its determinant are positive, that is the one solution. (Gains near 17 with a torque limit can make a diagonal
    element negative; the torque is then at a limit.)
    """
    d1, d2 = 1.0 + feedback[0][0], 1.0 + feedback[1][1]
    determinant = d1 * d2 - feedback[0][1] * feedback[1][0]
    free1 = (d2 * wanted[0] - feedback[0][1] * wanted[1]) / determinant
    free2 = (d1 * wanted[1] - feedback[1][0] * wanted[0]) / determinant
    cut2 = free2 - clip(free2, -limit[1], limit[1])  # 0 without limit: no small d1 can spoil the free solution
    tau1 = clip(free1 + feedback[0][1] * cut2 / at_least(d1, SMALL), -limit[0], limit[0])
    cut1 = free1 - tau1
    return [tau1, clip(free2 + feedback[1][0] * cut1 / at_least(d2, SMALL), -limit[1], limit[1])]
