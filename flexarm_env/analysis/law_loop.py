"""The paper's loop, linear: the Jacobian-transpose law (10), (14) around an arm at rest on its reference.

    tau = lambda J(theta)^T [Kp (r - p(late reading)) + Kd (r' - late or current rate of the point)]

About a rest with ``J^T (r - p) = 0`` it is ``tau = -lambda sum_k (P_k q(t - T_k) + V_k q'(t - T_k))`` with one term for
what is not late, one late by the shoulder's delay T, one late by the elbow's, r T. Where the sensed point can be on the
reference, the error is zero and the law's only terms are ``Kp J^T J`` and ``Kd J^T J``. A point that cannot reach the
reference (the paper's sensor 0.5 m past the elbow) pulls the arm straight; the error e that is left adds the stiffness
``-Kp d(J^T)/d(theta) e``.

What is neglected is what a moving reference adds: the rate error's term in d(J)/d(theta) theta', Coriolis and
centrifugal forces, bent links, and the error of a loop in motion.

Source: Green & Sasiadek, *Control of a flexible robot using fuzzy logic and a noncollocated sensor*, IFAC 2008: the law
(10), (14), its gains (11), (12), its Jacobian (13) and its delays (16), (18).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.analysis.operating_point import OperatingPoint
from flexarm_env.analysis.sensor import rigid_jacobian
from flexarm_env.parameters import LawParameters, SensorParameters, SensorTraits
from flexarm_env.physics.paths import inverse_kinematics
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import choice, finite_array, instance, number

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

# Delays nearer to each other than this, relatively, count as one: on an undamped arm the crossing curves of two nearly
# equal delays meet where the crossings are, and rounding hides these below 2e-6.
SAME_DELAY = 1e-5


@dataclass(frozen=True, eq=False)
class Feedback:
    """One term ``P q + V q'`` of the law at lambda = 1.

    Attributes:
        P: [N m per unit coordinate]. Shape (2, 2 + 2 m).
        V: [N m s per unit coordinate]. Shape (2, 2 + 2 m).
    """

    P: Array
    V: Array


@dataclass(frozen=True, eq=False)
class LawLoop:
    """A linear arm under the law; make one with `law_loop`.

    Attributes:
        point: where the arm rests.
        error: reference minus sensed point that is left there [m]. Shape (2,).
        gain: lambda.
        delay: T, of the shoulder's reading [s].
        ratio: r, the elbow's delay over the shoulder's, 0 or more; 1: both are late by one delay, to
            `SAME_DELAY`.
        current: what is not late.
        shoulder: what is late by T.
        elbow: what is late by r T.
    """

    point: OperatingPoint
    error: Array
    gain: float
    delay: float
    ratio: float
    current: Feedback
    shoulder: Feedback
    elbow: Feedback

    def with_gain(self, gain: float) -> LawLoop:
        """Return the same loop with another lambda, > 0."""
        return replace(self, gain=number("gain", gain, above=0.0))

    def with_delay(self, delay: float) -> LawLoop:
        """Return the same loop with another delay T [s] of the shoulder's reading; the elbow's follows."""
        return replace(self, delay=number("delay", delay, "s", least=0.0))

    def undelayed_poles(self) -> Complex:
        """Return the poles of the loop without any delay [rad/s]."""
        linear = self.point.linearisation
        total = sum((np.hstack([t.P, t.V]) for t in self.terms), start=np.zeros((2, len(linear.A))))
        return np.linalg.eigvals(linear.A - self.gain * linear.B @ total).astype(complex)

    @property
    def terms(self) -> Sequence[Feedback]:
        """Current, shoulder, elbow."""
        return self.current, self.shoulder, self.elbow

    def loop_terms(self, omega: Array) -> Complex:
        """Return the loop transfer ``lambda (P_k + s V_k) Q(s)`` of each term without its delay, s = j omega.

        Args:
            omega: [rad/s]. Shape (k,).

        Returns:
            For current, shoulder, elbow. Shape (k, 3, 2, 2).
        """
        s, response, *_ = self._response(omega)
        return np.stack([self.gain * (t.P + s * t.V) @ response for t in self.terms], axis=1)

    def loop_transfer(self, omega: Array) -> Complex:
        """Return L(j omega) with the delays, exact; the loop closes as ``1 + L``. Shape (k, 2, 2)."""
        late = np.exp(-1j * np.asarray(omega)[:, None] * self._delays)
        return np.asarray(np.einsum("kt,ktij->kij", late, self.loop_terms(omega)), dtype=complex)

    def loop_slope(self, omega: Array) -> Complex:
        """Return dL/ds at s = j omega. Shape (k, 2, 2)."""
        s, response, dynamic, dynamic_slope = self._response(omega)
        response_slope = -np.linalg.solve(dynamic, dynamic_slope @ response)
        total = np.zeros((len(s), 2, 2), dtype=complex)
        for term, delay in zip(self.terms, self._delays, strict=True):
            law = term.P + s * term.V
            total += np.exp(-s * delay) * ((term.V - delay * law) @ response + law @ response_slope)
        return np.asarray(self.gain * total, dtype=complex)

    @property
    def _delays(self) -> Array:
        return self.delay * np.array([0.0, 1.0, self.ratio])

    def _response(self, omega: Array) -> tuple[Complex, Complex, Complex, Complex]:
        """Return s, Shape (k, 1, 1), and the coordinates' response to torques, Shape (k, n, 2).

        Then the matrix ``s^2 - s A22 - A21`` that it inverts, and its derivative, Shape (k, n, n) each.
        """
        linear, half = self.point.linearisation, self.point.arm.size
        s = np.asarray(1j * np.asarray(omega)[:, None, None], dtype=complex)
        damping, eye = linear.A[half:, half:], np.eye(half)
        dynamic = np.asarray(s**2 * eye - s * damping - linear.A[half:, :half], dtype=complex)
        response = np.linalg.solve(dynamic, np.broadcast_to(linear.B[half:], (len(s), half, 2)))
        return s, response, dynamic, np.asarray(2.0 * s * eye - damping, dtype=complex)


def law_loop(
    arm: FlexibleArm,
    reference: ArrayLike,
    sensor: SensorParameters,
    gain: float = 1.0,
    law: LawParameters | None = None,
    elbow_branch: str = "positive",
) -> LawLoop:
    """Linearise the paper's loop about its rest under a constant reference.

    Args:
        arm: the arm.
        reference: x, y [m]. Shape (2,).
        sensor: where the sensor is, what it sees, how late it is, and whether rates are late. Under a "collocated" one
            both readings have one delay, 0.
        gain: lambda, > 0.
        law: Kp and Kd; default the paper's.
        elbow_branch: "positive" or "negative" theta2.

    Raises:
        ValueError: for bad numbers, a sensor off the link, a reference inside the hole that the sensed point cannot
            reach into, or an elbow's reading that is late while the shoulder's is not.
    """
    instance("arm", arm, FlexibleArm)
    instance("sensor", sensor, SensorParameters)
    law = LawParameters() if law is None else law
    instance("law", law, LawParameters)
    lambda_ = number("gain", gain, above=0.0)
    lengths = arm.parameters.link_lengths
    if sensor.position > lengths[1]:
        raise ValueError(f"sensor_position = {sensor.position} m: must be on link 2, > 0 and <= {lengths[1]} m")
    angles, error = rest_angles(arm, reference, sensor.position, elbow_branch)
    point = OperatingPoint.at_angles(arm, angles)
    jacobian = rigid_jacobian(lengths[0], sensor.position, point.q)
    rows = np.hstack([jacobian, np.zeros((2, arm.size - 2))])
    if sensor.traits.bends:
        rows = arm.point_jacobian(point.q, 2, sensor.position)
    stiffness, resistance = (k * jacobian.T @ rows for k in (law.proportional_gain, law.derivative_gain))
    turning = np.zeros_like(stiffness)
    turning[:, :2] = -law.proportional_gain * _turned(lengths[0], sensor.position, angles, error)
    nothing = np.zeros_like(stiffness)
    current, late = (nothing, resistance) if sensor.delayed == "position+rate" else (resistance, nothing)
    shoulder, elbow = (Feedback(c * stiffness, c * late) for c in _columns(arm.size, sensor.traits))
    delay, ratio = _delays(sensor, lengths[0])
    return LawLoop(
        point=point,
        error=error,
        gain=lambda_,
        delay=delay,
        ratio=ratio,
        current=Feedback(turning, current),
        shoulder=shoulder,
        elbow=elbow,
    )


def rest_angles(arm: FlexibleArm, reference: ArrayLike, distance: float, elbow_branch: str) -> tuple[Array, Array]:
    """Return where the law brings the arm to rest: on the reference, or stretched towards it.

    Args:
        arm: the arm.
        reference: x, y [m]. Shape (2,).
        distance: distance of the sensed point from the elbow [m].
        elbow_branch: "positive" or "negative" theta2.

    Returns:
        theta1, theta2 [rad], Shape (2,), and the error left [m], Shape (2,).
    """
    target = finite_array("reference", reference, (2,))
    choice("elbow_branch", elbow_branch, ("positive", "negative"))
    length = arm.parameters.link_lengths[0]
    away = float(np.linalg.norm(target))
    if away >= length + distance:
        direction = target / away
        return np.array([np.arctan2(target[1], target[0]), 0.0]), (away - length - distance) * direction
    if away < abs(length - distance):
        raise ValueError(
            f"reference = {tuple(target.tolist())} m: a point {distance} m from the elbow stays "
            f"{abs(length - distance):.4g} m away from the shoulder"
        )
    reach = replace(arm.parameters, link_lengths=(length, distance))
    return inverse_kinematics(reach, target, elbow_branch), np.zeros(2)


def _turned(length: float, distance: float, angles: Array, error: Array) -> Array:
    """Return d(J^T e)/d(theta) at constant e, of the point's position along e [m^2]. Shape (2, 2)."""
    one, both = angles[0], angles[0] + angles[1]
    second = -distance * (error @ np.array([np.cos(both), np.sin(both)]))
    first = second - length * (error @ np.array([np.cos(one), np.sin(one)]))
    return np.array([[first, second], [second, second]])


def _columns(size: int, traits: SensorTraits) -> tuple[Array, Array]:
    """Return which coordinates are late (1) by the shoulder's delay, and which by the elbow's. Shape (size,) each."""
    if traits.delays == "one":
        return np.ones(size), np.zeros(size)
    return np.eye(1, size)[0], np.eye(1, size, 1)[0]


def _delays(sensor: SensorParameters, length: float) -> tuple[float, float]:
    """Return the shoulder's delay [s], and the elbow's over it."""
    shoulder, elbow = sensor.joint_delays(length)
    if abs(shoulder - elbow) <= SAME_DELAY * shoulder:
        return shoulder, 1.0
    if shoulder == 0.0:
        raise ValueError(
            f"delay = {(shoulder, elbow)} s: the shoulder's must be > 0 where the elbow's is, which is taken in "
            f"proportion to it; nearest that is allowed: both 0, or a shoulder's of a little more, {1e-3 * elbow:g} s"
        )
    return shoulder, elbow / shoulder
