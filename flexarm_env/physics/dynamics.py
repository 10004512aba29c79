"""Equations of motion of the flexible arm, as plain functions of numbers.

They compute on floats and numpy arrays and are recorded into compiled kernels (`flexarm_env.codegen.tracing`), so they
hold no branches on data and take sines and cosines as arguments.

Symbols:
    a1, a2: absolute angles of the root tangents of link 1 and link 2 from the x axis [rad].
    q1, q2: modal coordinates of the links; a point of a link lies at (X, Y) along and across its root tangent: with
        linear kinematics at (x, w), ``w(x) = sum_i phi_i(x) q_i`` [m] (3), or foreshortened (see `bent_link`).
    y = (a1, q1, a2, q2): the internal coordinates; v = dy/dt.
    theta1 = a1, theta2 = a2 - a1 - w1'(L1): the joint angles [rad], what encoders read.
    e_i, n_i: unit vectors along and across link i's root tangent; C, S: cosine and sine of a2 - a1.
    E = X1(L1) e1 + Y1(L1) n1: the elbow; a point of link 2 is E + X2(x) e2 + Y2(x) n2.

With link 2's angle absolute, the two links couple only through the elbow's motion, the mass matrix is short, and
the velocity forces follow from the points' accelerations at v' = 0 (D'Alembert) in closed form:
``M(y) v' + h(y, v) + K y + D v = B tau`` (6). The lumped masses and inertias enter the constants alone.
"""

from __future__ import annotations

from typing import Any

from flexarm_env.codegen.tracing import Symbol, root
from flexarm_env.physics import bent_link, linear_algebra, modal_elimination
from flexarm_env.physics.bent_link import (
    PointShape,
    bent,
    modal_mass,
    root_coupling,
    root_inertia,
    velocity_acceleration,
)
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.linear_algebra import Factors, Matrix, Vector, dot, factor, less, place, symmetric_times
from flexarm_env.physics.modal_elimination import Elimination, Inertia


def joint_angles(k: Constants, y: Vector) -> tuple[Any, Any]:
    """Return (theta1, theta2) from the internal coordinates; applies to rates as well."""
    m = len(k.elbow_slopes)
    return y[0], y[m + 1] - y[0] - dot(k.elbow_slopes, y[1 : m + 1])


def internal_coordinates(k: Constants, q: Vector) -> list[Any]:
    """Return y = (a1, q1, a2, q2) from the public order (theta1, theta2, q1, q2); applies to rates as well."""
    m = len(k.elbow_slopes)
    q1 = list(q[2 : m + 2])
    return [q[0], *q1, q[0] + dot(k.elbow_slopes, q1) + q[1], *q[m + 2 :]]


def public_coordinates(k: Constants, y: Vector) -> list[Any]:
    """Inverse of `internal_coordinates`."""
    m = len(k.elbow_slopes)
    return [*joint_angles(k, y), *y[1 : m + 1], *y[m + 2 :]]


def elbow_turn(y: Vector) -> Any:
    """Return a2 - a1 [rad] from internal coordinates y, of which a2 begins the second half."""
    return y[len(y) // 2] - y[0]


def generalised_torque(k: Constants, tau: Vector) -> list[Any]:
    """Return B tau: the elbow's torque reacts on link 1's tip slope."""
    m = len(k.elbow_slopes)
    return [tau[0] - tau[1], *(-slope * tau[1] for slope in k.elbow_slopes), tau[1], *([0.0] * m)]


def point_force(k: Constants, at: PointShape, y: Vector, force: Vector, axes: tuple[Any, Any, Any, Any]) -> list[Any]:
    """Return the generalised force of a force at a point of link 2: the transposed Jacobian of the point times it.

    Args:
        k: constants.
        at: the point.
        y: internal coordinates.
        force: in the world's x and y [N].
        axes: sine and cosine of a1, sine and cosine of a2.
    """
    m = len(k.elbow_slopes)
    found: list[Any] = []
    for place_of, q, (sin, cos) in ((k.elbow, y[1 : m + 1], axes[:2]), (at, y[m + 2 :], axes[2:])):
        point = bent(place_of, q)
        along, across = force[0] * cos + force[1] * sin, force[1] * cos - force[0] * sin  # of the force, by e and n
        found.append(point.along * across - point.across * along)
        each = zip(point.values, point.foreshortening_gradient, strict=True)
        found += [value * across - gradient * along for value, gradient in each]
    return found


def mass_matrix(k: Constants, y: Vector, cos: Any, sin: Any) -> list[list[Any]]:
    """Return M(y), full and symmetric, in the order of y; `cos`, `sin`: C and S of a2 - a1."""
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
        rows[m + 1][1 + i] = elbow.values[i] * bending + elbow.foreshortening_gradient[i] * turning
        rows[m + 2 + i][0] = moment.values[i] * along - moment.foreshortening_gradient[i] * across
        gradient = moment.foreshortening_gradient[i]
        on_n1 = moment.values[i] * cos - gradient * sin
        on_e1 = moment.values[i] * sin + gradient * cos
        for j in range(m):
            rows[m + 2 + i][1 + j] = on_n1 * elbow.values[j] + on_e1 * elbow.foreshortening_gradient[j]
            if j <= i:
                rows[1 + i][1 + j] = mass[0][place(i, j)]
                rows[m + 2 + i][m + 2 + j] = mass[1][place(i, j)]
    for i in range(2 * m + 2):
        for j in range(i):
            rows[j][i] = rows[i][j]
    return rows


def inertia(k: Constants, e: Elimination | None, y: Vector, cos: Any, sin: Any) -> Inertia | Factors:
    """Return M(y) ready for `solve`: by elimination with linear kinematics, else (e is None) by a factorisation."""
    if e is not None:
        return modal_elimination.inertia(k, e, y, cos, sin)
    return factor(mass_matrix(k, y, cos, sin))


def solve(k: Constants, e: Elimination | None, at: Inertia | Factors, right: Vector) -> list[Any]:
    """Return x with ``M(y) x = right``, from `inertia`."""
    if isinstance(at, Factors):
        return linear_algebra.solve(at, right)
    assert e is not None
    return modal_elimination.solve(k, e, at, right)


def velocity_forces(k: Constants, y: Vector, v: Vector, cos: Any, sin: Any) -> list[Any]:
    """Return h(y, v): complete Coriolis and centrifugal forces, in the order of y."""
    m = len(k.elbow_slopes)
    w1, w2 = v[0], v[m + 1]  # angular velocities
    q1, q1_dot, q2, q2_dot = y[1 : m + 1], v[1 : m + 1], y[m + 2 :], v[m + 2 :]
    elbow, moment = bent(k.elbow, q1), bent(k.moment_2, q2)
    # elbow's acceleration at v' = 0 on -e1 and on -n1; and link 2's inertial force relative to the elbow
    elbow_e, elbow_n = velocity_acceleration(k.elbow, elbow, q1_dot, w1)
    link_e, link_n = velocity_acceleration(k.moment_2, moment, q2_dot, w2)
    elbow_on_n2, elbow_on_e2 = elbow_e * sin - elbow_n * cos, -(elbow_n * sin + elbow_e * cos)
    link_on_n1, link_on_e1 = -(link_n * cos + link_e * sin), link_n * sin - link_e * cos
    forces: list[Any] = []
    for point, on_n, on_e, link, q, rates, turn in (
        (elbow, link_on_n1, link_on_e1, k.links[0], q1, q1_dot, w1),
        (moment, elbow_on_n2, elbow_on_e2, k.links[1], q2, q2_dot, w2),
    ):
        root, modal = bent_link.velocity_forces(link, q, rates, turn)
        forces.append(root + point.along * on_n - point.across * on_e)
        each = zip(modal, point.values, point.foreshortening_gradient, strict=True)
        forces += [own + value * on_n - gradient * on_e for own, value, gradient in each]
    return forces


def momentum(k: Constants, y: Vector, v: Vector, cos: Any, sin: Any) -> list[Any]:
    """Return the generalised momenta ``p = M(y) v``, in the order of y."""
    return [dot(row, v) for row in mass_matrix(k, y, cos, sin)]


def kinetic_gradient(k: Constants, y: Vector, v: Vector, cos: Any, sin: Any) -> list[Any]:
    """Return dT/dy at constant v, T = v^T M(y) v / 2.

    The entries of a1 and a2 add up to 0, since a turn of the whole arm changes no energy. So the sum of their momenta
    is the time integral of the shoulder's torque, however coarse a step is.
    """
    m = len(k.elbow_slopes)
    w1, w2 = v[0], v[m + 1]
    q1, q1_dot, q2, q2_dot = y[1 : m + 1], v[1 : m + 1], y[m + 2 :], v[m + 2 :]
    elbow, moment = bent(k.elbow, q1), bent(k.moment_2, q2)
    # velocity of the elbow on e1 and n1, and of link 2's moment relative to the elbow on e2 and n2
    elbow_e = -dot(elbow.foreshortening_gradient, q1_dot, w1 * elbow.across)
    elbow_n = dot(elbow.values, q1_dot, w1 * elbow.along)
    link_e = -dot(moment.foreshortening_gradient, q2_dot, w2 * moment.across)
    link_n = dot(moment.values, q2_dot, w2 * moment.along)
    elbow_on_2 = cos * elbow_e + sin * elbow_n, cos * elbow_n - sin * elbow_e
    link_on_1 = cos * link_e - sin * link_n, sin * link_e + cos * link_n
    root = elbow_on_2[1] * link_e - elbow_on_2[0] * link_n
    gradient: list[Any] = []
    for at, point, (other_e, other_n), link, q, rates, turn, own_root in (
        (k.elbow, elbow, link_on_1, k.links[0], q1, q1_dot, w1, -root),
        (k.moment_2, moment, elbow_on_2, k.links[1], q2, q2_dot, w2, root),
    ):
        along, across = turn * other_n, turn * other_e
        drawn = symmetric_times(at.foreshortening, rates) if at.foreshortening else [0.0] * m
        own = bent_link.kinetic_gradient(link, q, rates, turn)
        each = zip(own, point.values, point.foreshortening_gradient, drawn, strict=True)
        gradient.append(own_root)
        gradient += [a - across * b - along * c - other_e * d for a, b, c, d in each]
    return gradient


def momentum_rate(
    k: Constants, complete: bool, y: Vector, v: Vector, tau: Vector, angles: tuple[Any, Any, Any]
) -> list[Any]:
    """Return p' of the torque-driven arm; arguments as of `acceleration`.

    ``p' = dT/dy + B (tau - friction) - K y - D v`` (Hamilton). The paper's C_r follows from no kinetic energy: with it
    h - C_r is added.
    """
    cos, sin, sin_theta2 = angles
    gradient = kinetic_gradient(k, y, v, cos, sin)
    if complete:
        return applied_forces(k, y, v, [-force for force in gradient], tau)
    pair = velocity_forces(k, y, v, cos, sin), rigid_velocity_forces(k, v, sin_theta2)
    return applied_forces(k, y, v, [c_r - h - force for h, c_r, force in zip(*pair, gradient, strict=True)], tau)


def rigid_velocity_forces(k: Constants, v: Vector, sin_theta2: Any) -> list[Any]:
    """Return the paper's C_r(theta, theta') (7), mapped from the joint rows to the order of y.

    In joint coordinates only the two joint rows are not zero; the virtual work of the elbow's row gives link 1's
    modal rows -phi'(L1) times it.
    """
    rate1, rate2 = joint_angles(k, v)
    mass = k.static_moment_2 * k.elbow_distance * sin_theta2
    shoulder = -mass * (2.0 * rate1 + rate2) * rate2
    elbow = mass * rate1 * rate1
    return generalised_torque(k, (shoulder, elbow))


def applied_forces(k: Constants, y: Vector, v: Vector, h: Vector, tau: Vector = (0.0, 0.0)) -> list[Any]:
    """Return the right-hand side: B (tau - friction) - h - K y - D v; tau: of the motors [N m]."""
    m = len(k.elbow_slopes)
    rate1, rate2 = joint_angles(k, v)
    acting = [tau[0] - k.friction_1 * rate1, tau[1] - k.friction_2 * rate2]
    if k.dry:
        acting = [torque - dry for torque, dry in zip(acting, dry_friction(k, (rate1, rate2)), strict=True)]
    joints = generalised_torque(k, acting)
    stiffness = (0.0, *k.stiffness_1, 0.0, *k.stiffness_2)
    damping = (0.0, *k.damping_1, 0.0, *k.damping_2)
    return [joints[i] - (h[i] + stiffness[i] * y[i] + damping[i] * v[i]) for i in range(2 * m + 2)]


def dry_friction(k: Constants, rates: Vector) -> list[Any]:
    """Return the dry friction of both joints [N m], positive against a positive rate.

    ``F = (Fc + (Fs - Fc) / (1 + (w / ws)^2)) s(w / w0)``: Coulomb's level Fc, the breakaway level Fs and the Stribeck
    velocity ws in the form of Hess and Soom (J. Tribology 112, 1990; Armstrong-Helouvry, Dupont and Canudas de Wit,
    Automatica 30, 1994, compare the forms), and the smooth sign ``s(x) = x / sqrt(1 + x^2)``. No exponential, so that
    other engines evaluate it as it stands (`flexarm_env.formulas`).

    Args:
        k: constants, with `Constants.dry_friction`.
        rates: of theta1 and theta2 [rad/s].
    """
    *levels, per_stribeck, per_smoothing = k.dry_friction
    friction = []
    for rate, coulomb, further in zip(rates, levels[::2], levels[1::2], strict=True):
        slow, x = rate * per_stribeck, rate * per_smoothing
        square = 1.0 + x * x
        length = root(square) if isinstance(square, Symbol) else square**0.5
        friction.append((coulomb + further / (1.0 + slow * slow)) * (x / length))
    return friction


def acceleration(
    k: Constants,
    e: Elimination | None,
    complete: bool,
    y: Vector,
    v: Vector,
    tau: Vector,
    angles: tuple[Any, Any, Any],
) -> list[Any]:
    """Return v' of the torque-driven arm (6).

    Args:
        k: constants.
        e: see `inertia`.
        complete: complete velocity forces, or the paper's C_r.
        y: internal coordinates.
        v: internal rates.
        tau: torques of shoulder and elbow [N m].
        angles: C and S of a2 - a1, and the sine of theta2 (used by C_r only).
    """
    cos, sin, _ = angles
    right = _right(k, complete, y, v, tau, angles)
    return solve(k, e, inertia(k, e, y, cos, sin), right)


def imbalance(
    k: Constants, complete: bool, y: Vector, v: Vector, rates: Vector, tau: Vector, angles: tuple[Any, Any, Any]
) -> list[Any]:
    """Return the right-hand side of (6) less M(y) v': zero where `rates`, v', are the acceleration.

    Its derivatives need no derivative of a factorisation: those of the acceleration follow by one more solution each
    (implicit functions; `linearisation`). Arguments as of `acceleration`.
    """
    cos, sin, _ = angles
    right = _right(k, complete, y, v, tau, angles)
    return [less(force, row, rates) for row, force in zip(mass_matrix(k, y, cos, sin), right, strict=True)]


def _right(k: Constants, complete: bool, y: Vector, v: Vector, tau: Vector, angles: tuple[Any, Any, Any]) -> list[Any]:
    """Right-hand side of (6); arguments as in `acceleration`."""
    cos, sin, sin_theta2 = angles
    h = velocity_forces(k, y, v, cos, sin) if complete else rigid_velocity_forces(k, v, sin_theta2)
    return applied_forces(k, y, v, h, tau)


def kinetic_energy(matrix: Matrix, v: Vector) -> Any:
    """Return v^T M v / 2 [J]."""
    return 0.5 * dot(v, [dot(row, v) for row in matrix])


def strain_energy(k: Constants, y: Vector) -> Any:
    """Return the bending energy of both links [J]."""
    m = len(k.elbow_slopes)
    q = [*y[1 : m + 1], *y[m + 2 :]]
    return 0.5 * dot([*k.stiffness_1, *k.stiffness_2], [x * x for x in q])


def angular_momentum(matrix: Matrix, v: Vector) -> Any:
    """Return the angular momentum about the shoulder [kg m^2/s]: a turn of the whole arm changes a1 and a2 equally."""
    m = len(v) // 2 - 1
    return dot(matrix[0], v) + dot(matrix[m + 1], v)
