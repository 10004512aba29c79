"""The arm under its law, solved independently: material points, quadrature and a stiff scipy solver.

The oracle knows nothing of `dynamics`, `jacobian_transpose` or `imex`; only the foreshortened arm's accelerations and
what the true sensor sees are the package's. It sums inertia over material points in joint coordinates, takes the law
from the paper (docs/reproduction.md) line by line, and integrates by scipy's LSODA with relative tolerance 1e-9 by the
method of steps: never a step longer than the shortest delay, the past read from the solver's own dense output, a fresh
start wherever the right-hand side jumps.
"""

from __future__ import annotations

import bisect
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray
from scipy.integrate import LSODA

from flexarm_env import ArmParameters, FlexibleArm, LawParameters, SensorParameters
from flexarm_env.physics.damping import clamped_ratio

Array = NDArray[np.float64]
PERIOD = 1e-3  # [s] control period
SIDE_TIME = 4.0  # [s] from one corner of the square to the next
PAPER = ArmParameters.paper()
COLLOCATED = SensorParameters("collocated")
PAPER_LAW = LawParameters()

# Points of the plane are complex numbers, x + iy; a prime is a rate. State: joint coordinates and their rates.


@njit(cache=True)
def mass_and_forces(q: Array, dq: Array, arm: Any) -> tuple[Array, Array]:
    """M(q) and h(q, q') + K q + D q' in joint coordinates, summed over material points of both links."""
    length1, length2, points1, points2, shapes1, shapes2, masses1, masses2, tip, slope = arm[:10]
    stiffness, damping, complete = arm[10:]
    m, n = len(tip), len(q)
    q1, q2, dq1, dq2 = q[2 : m + 2], q[m + 2 :], dq[2 : m + 2], dq[m + 2 :]
    angle, rate = q[0] + q[1] + _sum(slope, q1), dq[0] + dq[1] + _sum(slope, dq1)
    e1, e2 = np.exp(1j * q[0]), np.exp(1j * angle)  # along the root tangents; 1j * e1 is across
    elbow = (length1 + 1j * _sum(tip, q1)) * e1
    elbow_acceleration = -elbow * dq[0] ** 2 - 2.0 * _sum(tip, dq1) * dq[0] * e1  # accelerations are at q'' = 0
    M, h, J = np.zeros((n, n)), np.zeros(n), np.zeros(n, dtype=np.complex128)
    for k in range(len(points1)):
        r = points1[k] + 1j * _sum(shapes1[k], q1)
        J[0] = 1j * r * e1
        for i in range(m):
            J[2 + i] = 1j * shapes1[k, i] * e1
        _add_point(M, h, masses1[k], J, -(r * dq[0] + 2.0 * _sum(shapes1[k], dq1)) * dq[0] * e1)
    for k in range(len(points2)):
        r = points2[k] + 1j * _sum(shapes2[k], q2)
        J[0], J[1] = 1j * (elbow + r * e2), 1j * r * e2
        for i in range(m):
            J[2 + i] = 1j * (tip[i] * e1 + slope[i] * r * e2)
            J[2 + m + i] = 1j * shapes2[k, i] * e2
        acceleration = elbow_acceleration - (r * rate + 2.0 * _sum(shapes2[k], dq2)) * rate * e2
        _add_point(M, h, masses2[k], J, acceleration)
    if not complete:  # C_r (7): the rigid arm's, in the joint rows only
        coupling = np.sum(masses2) * 0.5 * length2 * length1 * np.sin(q[1])
        h[:] = 0.0
        h[0], h[1] = -coupling * (2.0 * dq[0] + dq[1]) * dq[1], coupling * dq[0] ** 2
    for i in range(2 * m):
        h[2 + i] += stiffness[i] * q[2 + i] + damping[i] * dq[2 + i]
    return M, h


@njit(cache=True)
def _sum(weights: Array, values: Array) -> float:
    """Return weights @ values, which takes ten times as long to compile."""
    total = 0.0
    for i in range(len(weights)):
        total += weights[i] * values[i]
    return total


@njit(cache=True)
def _add_point(M: Array, h: Array, mass: float, J: Any, acceleration: complex) -> None:
    """Add a material point's inertia to M, and its force at q'' = 0 to h. J: its velocities. Shape (n,), complex."""
    for i in range(len(J)):
        h[i] += mass * (np.conj(J[i]) * acceleration).real
        for j in range(len(J)):
            M[i, j] += mass * (np.conj(J[i]) * J[j]).real


def rigid_kinematics(theta1: float, theta2: float, length1: float, distance: float) -> tuple[complex, complex, complex]:
    """p (8), (9) and the columns of J (13), with L2 replaced by the sensor's distance from the elbow."""
    reach = distance * np.exp(1j * (theta1 + theta2))
    p = length1 * np.exp(1j * theta1) + reach
    return p, 1j * p, 1j * reach


def torque(x: Array, late: Array, command: Array, noise: complex, gain: float, arm: Any, law: Any) -> Array:
    """lambda J^T (Kp e + Kd e') (10), (14); `gain` is lambda, `arm` and `law`: see `oracle_arm` and `oracle_law`.

    `late`: states that the two joints' readings date from, Shape (2, 2 n); `command`: reference position and velocity
    in each joint's torque, Shape (2, 2), complex; `noise`: on the sensed position.
    """
    Kp, Kd, limit, distance, seen, late_rates, current_jacobian = law
    n = len(x) // 2
    p, J1, J2 = rigid_kinematics(x[0], x[1], arm[0], distance)
    columns = (J1, J2)
    if seen:
        p, dp = seen(late[0])
        if not late_rates:
            _, dp = seen(x)
    else:
        p, late_J1, late_J2 = rigid_kinematics(late[0, 0], late[1, 1], arm[0], distance)
        if current_jacobian:
            late_J1, late_J2 = J1, J2
        dp = late_J1 * x[n] + late_J2 * x[n + 1]
        if late_rates:
            dp = late_J1 * late[0, n] + late_J2 * late[1, n + 1]
    tau = np.zeros(2)
    for j in range(2):
        force = Kp * (command[j, 0] - p - noise) + Kd * (command[j, 1] - dp)
        tau[j] = min(max(gain * (np.conj(columns[j]) * force).real, -limit[j]), limit[j])
    return tau


def acceleration(x: Array, tau: Array, arm: Any) -> Array:
    """q'' under the motors' torques; `arm`: see `oracle_arm`."""
    n = len(x) // 2
    M, right = mass_and_forces(x[:n], x[n:], arm)
    right = -right
    right[:2] += tau
    return np.linalg.solve(M, right)


def oracle_arm(arm: FlexibleArm) -> tuple[Any, ...]:
    """Shapes, stiffness and frequencies of the modes: the package's (checked in tests/physics/test_link_modes.py)."""
    p, (one, two) = arm.parameters, arm.modes
    nodes, weights = np.polynomial.legendre.leggauss(20)  # 4 modes: products oscillate over 3.5 waves a link
    points = [0.5 * length * (nodes + 1.0) for length in p.link_lengths]
    masses = [0.5 * length * rho * weights for length, rho in zip(p.link_lengths, p.masses_per_length, strict=True)]
    stiffness = np.concatenate([one.stiffness, two.stiffness])
    omega = np.concatenate([one.frequencies, two.frequencies])
    damping = 2.0 * clamped_ratio(p) * stiffness / omega
    complete = p.velocity_forces == "complete"
    shapes = one.shape(points[0]), two.shape(points[1])
    return (*p.link_lengths, *points, *shapes, *masses, one.tip_values, one.tip_slopes, stiffness, damping, complete)


def oracle_law(problem: Problem, arm: FlexibleArm) -> tuple[Any, ...]:
    """Gains, torque limits, the sensor's place, what it sees unless joints are read, and which variants hold."""
    s, law = problem.sensor, problem.law
    limit = np.array(law.torque_limit or (np.inf, np.inf))

    def seen(x: Array) -> tuple[complex, complex]:
        return complex(*arm.position(x[: arm.size], 2, s.position)), complex(*arm.velocity(x, 2, s.position))

    variants = (seen if s.model == "true" else None, s.delayed == "position+rate", s.rate_jacobian == "current")
    return (law.proportional_gain, law.derivative_gain, limit, s.position, *variants)


def square_at(time: float, segment_of: float, clockwise: bool, side_time: float) -> tuple[complex, complex]:
    """Return the paper's square, or a smaller one at the same speed, from its lower left corner.

    `segment_of` picks the side where `time` is a corner's.
    """
    corner, velocity = -6.3 - 6.3j, 3.15j if clockwise else 3.15 + 0j
    if segment_of < 0.0:
        return corner, 0.0
    side = int(segment_of // side_time)
    for _ in range(side):  # each side is the one before, turned by 90 degrees
        corner += velocity * side_time
        velocity *= -1j if clockwise else 1j
    return corner + velocity * (time - side_time * side), velocity


@dataclass(frozen=True)
class Problem:
    """One arm on its way along the square."""

    arm: ArmParameters = PAPER
    sensor: SensorParameters = COLLOCATED
    law: LawParameters = PAPER_LAW
    periods: int = 16_000
    gain: float | Array = 1.0  # one for all control periods, or one for each
    noise: Array | None = None  # for each control period [m]
    clockwise: bool = True
    elbow: float = 1.0
    start: Array | None = None  # state; None: at rest on the corner
    side_time: float = SIDE_TIME

    def gains(self) -> Array:
        return np.broadcast_to(np.asarray(self.gain, dtype=float), self.periods)

    def noises(self) -> Array:
        return np.zeros((self.periods, 2)) if self.noise is None else self.noise

    def delays(self) -> tuple[float, float]:
        """(16), (18): distance over wave speed, unless given."""
        s = self.sensor
        if s.model == "collocated":
            return 0.0, 0.0
        if s.delay is not None:
            return s.delay if isinstance(s.delay, tuple) else (s.delay, s.delay)
        shoulder = (self.arm.link_lengths[0] + s.position) / 288.33
        return shoulder, shoulder if s.model == "true" else s.position / 288.33

    def command_delays(self) -> tuple[float, float]:
        shoulder, elbow = self.delays()
        by = {"none": (0.0, 0.0), "shared": (shoulder, shoulder), "per_joint": (shoulder, elbow)}
        return by[self.law.compensation]

    def start_state(self) -> Array:
        """At rest, straight links, the rigid tip on the lower left corner (law of cosines)."""
        if self.start is not None:
            return self.start
        length1, length2 = self.arm.link_lengths
        theta2 = self.elbow * np.arccos((2.0 * 6.3**2 - length1**2 - length2**2) / (2.0 * length1 * length2))
        theta1 = np.arctan2(-6.3, -6.3) - np.arctan2(length2 * np.sin(theta2), length1 + length2 * np.cos(theta2))
        return np.concatenate([[theta1, theta2], np.zeros(4 * self.arm.modes_per_link + 2)])

    def reference(self, time: float, segment_of: float) -> tuple[complex, complex]:
        return square_at(time, segment_of, self.clockwise, self.side_time)

    def breaks(self) -> list[float]:
        """Instants where the right-hand side jumps, and those where a delayed jump arrives."""
        jumps = {self.side_time * k + d for k in range(4) for d in (0.0, *self.delays(), *self.command_delays())}
        for signal in (self.gains()[:, None], self.noises()):
            jumps |= {PERIOD * k for k in 1 + np.flatnonzero(np.any(np.diff(signal, axis=0) != 0.0, axis=1))}
        end = self.periods * PERIOD
        return [*sorted(t for t in jumps if t < end), end]


def oracle(problem: Problem) -> Array:
    """States at all control instants. Shape (periods + 1, 4 + 4 m)."""
    arm = FlexibleArm(problem.arm)
    data, law = oracle_arm(arm), oracle_law(problem, arm)
    linear = problem.arm.kinematics == "linear"
    delays, command_delays = problem.delays(), problem.command_delays()
    longest_step = min([d for d in delays if d > 0.0], default=np.inf)

    x = problem.start_state()
    before = np.where(np.arange(len(x)) < len(x) // 2, x, 0.0)  # until the start nothing moves
    ends: list[float] = []
    pieces: list[Callable[[float], Array]] = []

    def past(t: float) -> Array:
        if t <= 0.0:
            return before
        assert t <= ends[-1] * (1.0 + 1e-12), "the step was longer than the delay"
        return pieces[min(bisect.bisect_left(ends, t), len(ends) - 1)](t)

    times = PERIOD * np.arange(problem.periods + 1)
    states = np.empty((len(times), len(x)))
    states[0], done = x, 1
    breaks = problem.breaks()
    for begin, end in zip(breaks[:-1], breaks[1:], strict=True):
        middle = 0.5 * (begin + end)
        period = int(middle / PERIOD)
        gain, noise = problem.gains()[period], complex(*problem.noises()[period])

        def rate(t: float, x: Array, middle: float = middle, gain: float = gain, noise: complex = noise) -> Array:
            late = np.array([past(t - d) if d > 0.0 else x for d in delays])
            command = np.array([problem.reference(t - d, middle - d) for d in command_delays])
            tau = torque(x, late, command, noise, gain, data, law)
            return np.append(x[arm.size :], acceleration(x, tau, data) if linear else arm.acceleration(x, tau))

        solver = LSODA(rate, begin, x, end, rtol=1e-9, atol=1e-10, max_step=longest_step)
        while solver.status == "running":
            message = solver.step()
            assert solver.status != "failed", message
            piece = solver.dense_output()
            forgotten = bisect.bisect_left(ends, solver.t - max(delays))
            ends[:] = [*ends[forgotten:], solver.t]
            pieces[:] = [*pieces[forgotten:], piece]
            while done < len(times) and times[done] <= solver.t + 1e-12:
                states[done] = solver.y if abs(times[done] - solver.t) < 1e-12 else piece(times[done])
                done += 1
        x = solver.y
    assert done == len(times)
    return states
