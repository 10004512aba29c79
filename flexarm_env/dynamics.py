"""Equations of motion of the flexible arm, as plain functions of numbers.

They compute on floats and numpy arrays and are recorded into compiled kernels (`flexarm_env.tracing`), so they
hold no branches on data and take sines and cosines as arguments.

Symbols:
    a1, a2: absolute angles of the root tangents of link 1 and link 2 from the x axis [rad].
    q1, q2: modal coordinates of the links; ``w(x) = sum_i phi_i(x) q_i`` is a link's deflection [m] (3).
    y = (a1, q1, a2, q2): the internal coordinates; v = dy/dt.
    theta1 = a1, theta2 = a2 - a1 - w1'(L1): the joint angles [rad], what encoders read.
    e_i, n_i: unit vectors along and across link i's root tangent; C, S: cosine and sine of a2 - a1.
    E = L1 e1 + w1(L1) n1: the elbow; a point of link 2 is E + x e2 + w2(x) n2.

With link 2's angle absolute, the two links couple only through the elbow's motion, the mass matrix is short, and
the velocity forces follow from the points' accelerations at v' = 0 (D'Alembert) in closed form:
``M(y) v' + h(y, v) + K y + D v = B tau`` (6). The lumped masses and inertias enter the constants alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from flexarm_env.modes import LinkModes, link_modes
from flexarm_env.parameters import ArmParameters

Vector = Sequence[Any]
Matrix = Sequence[Sequence[Any]]


class Constants(NamedTuple):
    """Everything the equations know of an arm; each field a number or a tuple over modes.

    Link i with what is fixed to it: ``inertia`` about its root [kg m^2]; ``coupling``, moment of inertia between
    root rotation and mode; ``mass``, modal mass matrix (lower triangle, row by row); ``static_moment`` [kg m];
    ``momentum``, integral of the mode over mass. Link 1 carries the elbow's mass, all of link 2 and the payload at
    its tip; link 2 carries the elbow hub's inertia and the payload. ``translation_2`` is ``mass_2`` without the
    payload's rotary inertia, which has no centrifugal effect.
    """

    elbow_distance: Any
    inertia_1: Any
    inertia_2: Any
    static_moment_2: Any
    friction_1: Any
    friction_2: Any
    elbow_values: Vector
    elbow_slopes: Vector
    coupling_1: Vector
    coupling_2: Vector
    momentum_2: Vector
    stiffness_1: Vector
    stiffness_2: Vector
    damping_1: Vector
    damping_2: Vector
    mass_1: Vector
    mass_2: Vector
    translation_2: Vector

    @staticmethod
    def sizes(modes: int) -> list[int | None]:
        """Length of each field for a number of modes; None for a number."""
        return [None] * 6 + [modes] * 9 + [modes * (modes + 1) // 2] * 3

    def flat(self) -> list[Any]:
        """All numbers in order, as a kernel reads them."""
        return [x for field in self for x in (field if isinstance(field, tuple | list) else [field])]

    @classmethod
    def unflat(cls, numbers: Sequence[Any], modes: int) -> Constants:
        """Inverse of `flat`."""
        source = iter(numbers)
        return cls(*(next(source) if n is None else _take(source, n) for n in cls.sizes(modes)))


def _take(source: Iterator[Any], count: int) -> tuple[Any, ...]:
    return tuple(next(source) for _ in range(count))


def arm_modes(parameters: ArmParameters) -> tuple[LinkModes, LinkModes]:
    """Modes of the two bare links."""
    p = parameters
    first, second = (
        link_modes(length, rigidity, density, p.modes_per_link, p.mode_scale)
        for length, rigidity, density in zip(p.link_lengths, p.flexural_rigidities, p.masses_per_length, strict=True)
    )
    return first, second


def arm_constants(parameters: ArmParameters, modes: tuple[LinkModes, LinkModes]) -> Constants:
    """Fold modal integrals and lumped masses into the equations' constants; floats only."""
    p = parameters
    one, two = modes
    (length_1, length_2), (rho_1, rho_2) = p.link_lengths, p.masses_per_length
    at_elbow = p.elbow_mass + rho_2 * length_2 + p.payload_mass  # what link 1 carries at its tip
    slope_2 = two.tip_slopes
    translation_2 = two.mass + p.payload_mass * np.outer(two.tip_values, two.tip_values)
    mass_2 = translation_2 + p.payload_inertia * np.outer(slope_2, slope_2)
    hub_and_payload = p.elbow_hub_inertia + p.payload_mass * length_2**2 + p.payload_inertia
    coupling_2 = two.second_moment + p.payload_mass * length_2 * two.tip_values + p.payload_inertia * slope_2
    damping = [2.0 * p.modal_damping_ratio * link.frequencies * np.diag(link.mass) for link in modes]
    return Constants(
        elbow_distance=length_1,
        inertia_1=rho_1 * length_1**3 / 3.0 + p.shoulder_hub_inertia + at_elbow * length_1**2,
        inertia_2=rho_2 * length_2**3 / 3.0 + hub_and_payload,
        static_moment_2=rho_2 * length_2**2 / 2.0 + p.payload_mass * length_2,
        friction_1=p.joint_friction[0],
        friction_2=p.joint_friction[1],
        elbow_values=_floats(one.tip_values),
        elbow_slopes=_floats(one.tip_slopes),
        coupling_1=_floats(one.second_moment + at_elbow * length_1 * one.tip_values),
        coupling_2=_floats(coupling_2),
        momentum_2=_floats(two.first_moment + p.payload_mass * two.tip_values),
        stiffness_1=_floats(one.stiffness),
        stiffness_2=_floats(two.stiffness),
        damping_1=_floats(damping[0]),
        damping_2=_floats(damping[1]),
        mass_1=_lower(one.mass + at_elbow * np.outer(one.tip_values, one.tip_values)),
        mass_2=_lower(mass_2),
        translation_2=_lower(translation_2),
    )


def _floats(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _lower(matrix: np.ndarray) -> tuple[float, ...]:
    return _floats(matrix[np.tril_indices(len(matrix))])


def dot(a: Vector, b: Vector) -> Any:
    """Sum of products, in order."""
    total: Any = 0.0
    for x, z in zip(a, b, strict=True):
        total = total + x * z
    return total


def _symmetric_times(lower: Vector, b: Vector) -> list[Any]:
    n = len(b)
    return [dot([lower[max(i, j) * (max(i, j) + 1) // 2 + min(i, j)] for j in range(n)], b) for i in range(n)]


def joint_angles(k: Constants, y: Vector) -> tuple[Any, Any]:
    """(theta1, theta2) from the internal coordinates; applies to rates as well."""
    m = len(k.elbow_slopes)
    return y[0], y[m + 1] - y[0] - dot(k.elbow_slopes, y[1 : m + 1])


def internal_coordinates(k: Constants, q: Vector) -> list[Any]:
    """y = (a1, q1, a2, q2) from the public order (theta1, theta2, q1, q2); applies to rates as well."""
    m = len(k.elbow_slopes)
    q1 = list(q[2 : m + 2])
    return [q[0], *q1, q[0] + dot(k.elbow_slopes, q1) + q[1], *q[m + 2 :]]


def generalised_torque(k: Constants, tau: Vector) -> list[Any]:
    """B tau: the elbow's torque reacts on link 1's tip slope."""
    m = len(k.elbow_slopes)
    return [tau[0] - tau[1], *(-slope * tau[1] for slope in k.elbow_slopes), tau[1], *([0.0] * m)]


def mass_matrix(k: Constants, y: Vector, cos: Any, sin: Any) -> list[list[Any]]:
    """M(y), full and symmetric, in the order of y.

    Args:
        k: constants.
        y: internal coordinates.
        cos: C, cosine of a2 - a1.
        sin: S, sine of a2 - a1.
    """
    m = len(k.elbow_slopes)
    q1, q2 = y[1 : m + 1], y[m + 2 :]
    deflection = dot(k.elbow_values, q1)  # w1(L1)
    momentum = dot(k.momentum_2, q2)
    along = k.elbow_distance * cos + deflection * sin  # d(elbow velocity)/d(a1') on n2, and on e2:
    across = k.elbow_distance * sin - deflection * cos
    rows: list[list[Any]] = [[0.0] * (2 * m + 2) for _ in range(2 * m + 2)]
    rows[0][0] = k.inertia_1 + dot(q1, _symmetric_times(k.mass_1, q1))
    rows[m + 1][m + 1] = k.inertia_2 + dot(q2, _symmetric_times(k.translation_2, q2))
    rows[m + 1][0] = k.static_moment_2 * along - momentum * across
    bending = k.static_moment_2 * cos - momentum * sin
    for i in range(m):
        rows[1 + i][0] = k.coupling_1[i]
        rows[m + 2 + i][m + 1] = k.coupling_2[i]
        rows[m + 1][1 + i] = k.elbow_values[i] * bending
        rows[m + 2 + i][0] = k.momentum_2[i] * along
        for j in range(m):
            rows[m + 2 + i][1 + j] = k.momentum_2[i] * k.elbow_values[j] * cos
            if j <= i:
                rows[1 + i][1 + j] = k.mass_1[i * (i + 1) // 2 + j]
                rows[m + 2 + i][m + 2 + j] = k.mass_2[i * (i + 1) // 2 + j]
    for i in range(2 * m + 2):
        for j in range(i):
            rows[j][i] = rows[i][j]
    return rows


def velocity_forces(k: Constants, y: Vector, v: Vector, cos: Any, sin: Any) -> list[Any]:
    """h(y, v): complete Coriolis and centrifugal forces, in the order of y."""
    m = len(k.elbow_slopes)
    w1, w2 = v[0], v[m + 1]  # angular velocities
    q1, q1_dot, q2, q2_dot = y[1 : m + 1], v[1 : m + 1], y[m + 2 :], v[m + 2 :]
    deflection, deflection_rate = dot(k.elbow_values, q1), dot(k.elbow_values, q1_dot)
    momentum, momentum_rate = dot(k.momentum_2, q2), dot(k.momentum_2, q2_dot)
    # elbow's acceleration at v' = 0 on -n1 and on -e1; and link 2's inertial force relative to the elbow
    elbow_n = deflection * w1 * w1
    elbow_e = (2.0 * deflection_rate + k.elbow_distance * w1) * w1
    link_n = momentum * w2 * w2
    link_e = (2.0 * momentum_rate + k.static_moment_2 * w2) * w2
    elbow_on_n2, elbow_on_e2 = elbow_e * sin - elbow_n * cos, -(elbow_n * sin + elbow_e * cos)
    link_on_n1, link_on_e1 = -(link_n * cos + link_e * sin), link_n * sin - link_e * cos
    mass_q1, mass_q2 = _symmetric_times(k.mass_1, q1), _symmetric_times(k.translation_2, q2)
    return [
        2.0 * w1 * dot(mass_q1, q1_dot) + k.elbow_distance * link_on_n1 - deflection * link_on_e1,
        *(k.elbow_values[i] * link_on_n1 - w1 * w1 * mass_q1[i] for i in range(m)),
        2.0 * w2 * dot(mass_q2, q2_dot) + k.static_moment_2 * elbow_on_n2 - momentum * elbow_on_e2,
        *(k.momentum_2[i] * elbow_on_n2 - w2 * w2 * mass_q2[i] for i in range(m)),
    ]


def rigid_velocity_forces(k: Constants, v: Vector, sin_theta2: Any) -> list[Any]:
    """The paper's C_r(theta, theta') (7), mapped from the joint rows to the order of y.

    In joint coordinates only the two joint rows are not zero; the virtual work of the elbow's row gives link 1's
    modal rows -phi'(L1) times it.

    Args:
        k: constants.
        v: internal rates.
        sin_theta2: sine of the joint angle theta2.
    """
    rate1, rate2 = joint_angles(k, v)
    mass = k.static_moment_2 * k.elbow_distance * sin_theta2
    shoulder = -mass * (2.0 * rate1 + rate2) * rate2
    elbow = mass * rate1 * rate1
    return generalised_torque(k, (shoulder, elbow))


def applied_forces(k: Constants, y: Vector, v: Vector, h: Vector) -> list[Any]:
    """Right-hand side without motor torques: -h - K y - D v - B friction."""
    m = len(k.elbow_slopes)
    rate1, rate2 = joint_angles(k, v)
    friction = generalised_torque(k, (k.friction_1 * rate1, k.friction_2 * rate2))
    stiffness = (0.0, *k.stiffness_1, 0.0, *k.stiffness_2)
    damping = (0.0, *k.damping_1, 0.0, *k.damping_2)
    return [-(h[i] + stiffness[i] * y[i] + damping[i] * v[i] + friction[i]) for i in range(2 * m + 2)]


def factor(matrix: Matrix) -> tuple[list[list[Any]], list[Any]]:
    """L and 1/d of M = L diag(d) L^T, without pivoting (M is positive definite)."""
    n = len(matrix)
    lower: list[list[Any]] = [[0.0] * n for _ in range(n)]
    scaled: list[list[Any]] = [[0.0] * n for _ in range(n)]  # L diag(d)
    inverse: list[Any] = []
    for i in range(n):
        for j in range(i):
            scaled[i][j] = matrix[i][j] - dot(scaled[i][:j], lower[j][:j])
            lower[i][j] = scaled[i][j] * inverse[j]
        inverse.append(1.0 / (matrix[i][i] - dot(scaled[i][:i], lower[i][:i])))
    return lower, inverse


def solve(factors: tuple[list[list[Any]], list[Any]], right: Vector) -> list[Any]:
    """x with M x = right, from `factor`."""
    lower, inverse = factors
    n = len(right)
    x: list[Any] = []
    for i in range(n):
        x.append(right[i] - dot(lower[i][:i], x))
    x = [value * scale for value, scale in zip(x, inverse, strict=True)]
    for i in reversed(range(n)):
        x[i] = x[i] - dot([lower[j][i] for j in range(i + 1, n)], x[i + 1 :])
    return x


def acceleration(
    k: Constants, complete: bool, y: Vector, v: Vector, tau: Vector, angles: tuple[Any, Any, Any]
) -> list[Any]:
    """v' of the torque-driven arm (6).

    Args:
        k: constants.
        complete: complete velocity forces, or the paper's C_r.
        y: internal coordinates.
        v: internal rates.
        tau: torques of shoulder and elbow [N m].
        angles: C and S of a2 - a1, and the sine of theta2 (used by C_r only).
    """
    cos, sin, sin_theta2 = angles
    h = velocity_forces(k, y, v, cos, sin) if complete else rigid_velocity_forces(k, v, sin_theta2)
    passive = applied_forces(k, y, v, h)
    right = [f + t for f, t in zip(passive, generalised_torque(k, tau), strict=True)]
    return solve(factor(mass_matrix(k, y, cos, sin)), right)


def kinetic_energy(matrix: Matrix, v: Vector) -> Any:
    """v^T M v / 2 [J]."""
    return 0.5 * dot(v, [dot(row, v) for row in matrix])


def strain_energy(k: Constants, y: Vector) -> Any:
    """Bending energy of both links [J]."""
    m = len(k.elbow_slopes)
    q = [*y[1 : m + 1], *y[m + 2 :]]
    return 0.5 * dot([*k.stiffness_1, *k.stiffness_2], [x * x for x in q])


def angular_momentum(matrix: Matrix, v: Vector) -> Any:
    """About the shoulder [kg m^2/s]: the momenta of a1 and a2 are rotated together by a turn of the whole arm."""
    m = len(v) // 2 - 1
    return dot(matrix[0], v) + dot(matrix[m + 1], v)
