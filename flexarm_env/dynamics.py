"""Equations of motion of the flexible arm, as plain functions of numbers.

They compute on floats and numpy arrays and are recorded into compiled kernels (`flexarm_env.tracing`), so they
hold no branches on data and take sines and cosines as arguments.

Symbols:
    a1, a2: absolute angles of the root tangents of link 1 and link 2 from the x axis [rad].
    q1, q2: modal coordinates of the links; a point of a link lies at (X, Y) along and across its root tangent: with
        linear kinematics at (x, w), ``w(x) = sum_i phi_i(x) q_i`` [m] (3), or foreshortened (see `links`).
    y = (a1, q1, a2, q2): the internal coordinates; v = dy/dt.
    theta1 = a1, theta2 = a2 - a1 - w1'(L1): the joint angles [rad], what encoders read.
    e_i, n_i: unit vectors along and across link i's root tangent; C, S: cosine and sine of a2 - a1.
    E = X1(L1) e1 + Y1(L1) n1: the elbow; a point of link 2 is E + X2(x) e2 + Y2(x) n2.

With link 2's angle absolute, the two links couple only through the elbow's motion, the mass matrix is short, and
the velocity forces follow from the points' accelerations at v' = 0 (D'Alembert) in closed form:
``M(y) v' + h(y, v) + K y + D v = B tau`` (6). The lumped masses and inertias enter the constants alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from flexarm_env.algebra import Matrix, Vector, dot, factor, place, solve
from flexarm_env.links import (
    Link,
    Place,
    bent,
    drawn_in,
    modal_mass,
    outward,
    root_coupling,
    root_inertia,
    shortening_forces,
)
from flexarm_env.modes import LinkModes, foreshortening_moments, link_modes
from flexarm_env.parameters import ArmParameters


class Constants(NamedTuple):
    """Everything the equations know of an arm; each field a number or a tuple over modes.

    Link i with what is fixed to it: ``inertia`` about its root [kg m^2]; ``coupling``, moment of inertia between
    root rotation and mode; ``mass``, modal mass matrix (lower triangle, row by row); ``static_moment`` [kg m];
    ``momentum``, integral of the mode over mass. Link 1 carries the elbow's mass, all of link 2 and the payload at
    its tip; link 2 carries the elbow hub's inertia and the payload. ``translation_2`` is ``mass_2`` without the
    payload's rotary inertia, which has no centrifugal effect.

    The last eight are empty with linear kinematics (`links`): S at the elbow, the moments of S, and of link 2 the
    integral of S over mass.
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
    elbow_foreshortening: Vector = ()
    mean_foreshortening_2: Vector = ()
    shortened_1: Vector = ()
    shortened_2: Vector = ()
    cubic_1: Vector = ()
    cubic_2: Vector = ()
    quartic_1: Vector = ()
    quartic_2: Vector = ()

    @staticmethod
    def sizes(modes: int, foreshortened: bool = False) -> list[int | None]:
        """Length of each field for a number of modes; None for a number."""
        pairs = modes * (modes + 1) // 2
        further = [pairs] * 4 + [modes * pairs] * 2 + [pairs * (pairs + 1) // 2] * 2
        return [None] * 6 + [modes] * 9 + [pairs] * 3 + [count * foreshortened for count in further]

    @property
    def foreshortened(self) -> bool:
        """Whether the kinematics are."""
        return bool(self.elbow_foreshortening)

    @property
    def elbow(self) -> Place:
        """Link 1's tip."""
        return Place(self.elbow_distance, self.elbow_values, self.elbow_foreshortening)

    @property
    def moment_2(self) -> Place:
        """First moment of link 2's mass and the payload's."""
        return Place(self.static_moment_2, self.momentum_2, self.mean_foreshortening_2)

    @property
    def links(self) -> tuple[Link, Link]:
        """Inertia of both links; link 1 has no rotary inertia at its tip."""
        further = (self.shortened_1, self.cubic_1, self.quartic_1), (self.shortened_2, self.cubic_2, self.quartic_2)
        return (
            Link(self.inertia_1, self.coupling_1, self.mass_1, self.mass_1, *further[0]),
            Link(self.inertia_2, self.coupling_2, self.mass_2, self.translation_2, *further[1]),
        )

    def flat(self) -> list[Any]:
        """All numbers in order, as a kernel reads them."""
        return [x for field in self for x in (field if isinstance(field, tuple | list) else [field])]

    @classmethod
    def unflat(cls, numbers: Sequence[Any], modes: int, foreshortened: bool = False) -> Constants:
        """Inverse of `flat`."""
        source = iter(numbers)
        sizes = cls.sizes(modes, foreshortened)
        return cls(*(next(source) if n is None else _take(source, n) for n in sizes))


def _take(source: Iterator[Any], count: int) -> tuple[Any, ...]:
    return tuple(next(source) for _ in range(count))


def arm_modes(parameters: ArmParameters) -> tuple[LinkModes, LinkModes]:
    """Modes of the two bare links."""
    p = parameters
    first, second = (
        link_modes(length, rigidity, density, p.modes_per_link, p.mode_scale, p.mode_shapes)
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
        **(_foreshortening(modes, (at_elbow, p.payload_mass)) if p.kinematics == "foreshortened" else {}),
    )


def link_place(modes: LinkModes, foreshortened: bool, s: float) -> Place:
    """A point of a link at the distance s [m] from its root; floats only."""
    sums = _lower(modes.foreshortening(s)) if foreshortened else ()
    return Place(float(s), _floats(modes.shape(s)), sums)


def _foreshortening(modes: tuple[LinkModes, LinkModes], carried: tuple[float, float]) -> dict[str, tuple[float, ...]]:
    """The fields of `Constants` that linear kinematics leave empty; `carried`: masses at the links' tips [kg]."""
    one, two = (foreshortening_moments(link, mass) for link, mass in zip(modes, carried, strict=True))
    return {
        "elbow_foreshortening": _lower(modes[0].foreshortening(modes[0].length)),
        "mean_foreshortening_2": _lower(two.mean),
        "shortened_1": _lower(one.shortened),
        "shortened_2": _lower(two.shortened),
        "cubic_1": tuple(x for matrix in one.cubic for x in _lower(matrix)),
        "cubic_2": tuple(x for matrix in two.cubic for x in _lower(matrix)),
        "quartic_1": _lower(one.quartic),
        "quartic_2": _lower(two.quartic),
    }


def _floats(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _lower(matrix: np.ndarray) -> tuple[float, ...]:
    return _floats(matrix[np.tril_indices(len(matrix))])


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
    (one, two), elbow, moment = k.links, bent(k.elbow, q1), bent(k.moment_2, q2)
    along = elbow.along * cos + elbow.across * sin  # d(elbow velocity)/d(a1') on n2, and on e2:
    across = elbow.along * sin - elbow.across * cos
    rows: list[list[Any]] = [[0.0] * (2 * m + 2) for _ in range(2 * m + 2)]
    rows[0][0] = root_inertia(one, q1)
    rows[m + 1][m + 1] = root_inertia(two, q2)
    rows[m + 1][0] = moment.along * along - moment.across * across
    bending = moment.along * cos - moment.across * sin  # link 2's moment on e1, and on n1:
    turning = moment.along * sin + moment.across * cos
    coupling, mass = (root_coupling(one, q1), root_coupling(two, q2)), (modal_mass(one, q1), modal_mass(two, q2))
    for i in range(m):
        rows[1 + i][0] = coupling[0][i]
        rows[m + 2 + i][m + 1] = coupling[1][i]
        rows[m + 1][1 + i] = elbow.values[i] * bending + elbow.slack[i] * turning
        rows[m + 2 + i][0] = moment.values[i] * along - moment.slack[i] * across
        for j in range(m):
            on_n1 = moment.values[i] * elbow.values[j] * cos - moment.slack[i] * elbow.values[j] * sin
            on_e1 = moment.values[i] * elbow.slack[j] * sin + moment.slack[i] * elbow.slack[j] * cos
            rows[m + 2 + i][1 + j] = on_n1 + on_e1
            if j <= i:
                rows[1 + i][1 + j] = mass[0][place(i, j)]
                rows[m + 2 + i][m + 2 + j] = mass[1][place(i, j)]
    for i in range(2 * m + 2):
        for j in range(i):
            rows[j][i] = rows[i][j]
    return rows


def velocity_forces(k: Constants, y: Vector, v: Vector, cos: Any, sin: Any) -> list[Any]:
    """h(y, v): complete Coriolis and centrifugal forces, in the order of y."""
    m = len(k.elbow_slopes)
    w1, w2 = v[0], v[m + 1]  # angular velocities
    q1, q1_dot, q2, q2_dot = y[1 : m + 1], v[1 : m + 1], y[m + 2 :], v[m + 2 :]
    (one, two), elbow, moment = k.links, bent(k.elbow, q1), bent(k.moment_2, q2)
    # elbow's acceleration at v' = 0 on -n1 and on -e1; and link 2's inertial force relative to the elbow
    elbow_n = elbow.across * w1 * w1 + 2.0 * dot(elbow.slack, q1_dot) * w1
    elbow_e = (2.0 * dot(elbow.values, q1_dot) + elbow.along * w1) * w1 + drawn_in(k.elbow, q1_dot)
    link_n = moment.across * w2 * w2 + 2.0 * dot(moment.slack, q2_dot) * w2
    link_e = (2.0 * dot(moment.values, q2_dot) + moment.along * w2) * w2 + drawn_in(k.moment_2, q2_dot)
    elbow_on_n2, elbow_on_e2 = elbow_e * sin - elbow_n * cos, -(elbow_n * sin + elbow_e * cos)
    link_on_n1, link_on_e1 = -(link_n * cos + link_e * sin), link_n * sin - link_e * cos
    out1, out2 = outward(one, q1), outward(two, q2)
    root1, modal1 = shortening_forces(one, q1, q1_dot, w1)
    root2, modal2 = shortening_forces(two, q2, q2_dot, w2)
    return [
        2.0 * w1 * dot(out1, q1_dot) + root1 + elbow.along * link_on_n1 - elbow.across * link_on_e1,
        *(elbow.values[i] * link_on_n1 - elbow.slack[i] * link_on_e1 - w1 * w1 * out1[i] + modal1[i] for i in range(m)),
        2.0 * w2 * dot(out2, q2_dot) + root2 + moment.along * elbow_on_n2 - moment.across * elbow_on_e2,
        *(
            moment.values[i] * elbow_on_n2 - moment.slack[i] * elbow_on_e2 - w2 * w2 * out2[i] + modal2[i]
            for i in range(m)
        ),
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
