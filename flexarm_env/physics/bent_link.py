"""One bent link in the frame of its root tangent, as plain functions of numbers (see `dynamics`).

A point at the distance x along the link lies at (X, Y) = (x - u, w): ``w = sum_i phi_i(x) q_i`` (3), and the
foreshortening ``u = q^T S(x) q / 2``, where ``S_ij(x)`` is the integral of phi_i' phi_j' from the root to x.
``w'`` is the angle of the link's tangent against the root's, so that bending energy, joint angles and the angles of
hubs are those of an inextensible beam, X is right to second order in q, and Y lacks only terms of third order.
With linear kinematics S is left out (its sequences are empty) and nothing of it is recorded.

Source: Kane, Ryan & Banerjee, *Dynamics of a cantilever beam attached to a moving base*, J. Guidance 10 (1987), on why
a spinning beam needs it and how it enters; the integrals over two links and the kernels' form of them are our own.

T and G are the moments of the foreshortening: ``T_k,ij`` integral of phi_k S_ij, ``G_ij,kl`` of S_ij S_kl over mass.
They are symmetric in i, j and in k, l. Three contractions serve all terms: P = sum_k q_k T_k, the skew matrix
``A_kj = sum_i (T_k,ji - T_j,ki) q_i`` and ``Z_i,jl = sum_k q_k G_ik,jl``; Z q is what foreshortening adds to the modal
mass, symmetric as well.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flexarm_env.physics.linear_algebra import Vector, dot, place, products, symmetric_times


class PointShape(NamedTuple):
    """A point of a link; or the integrals of these quantities over a link's mass (`Constants.moment_2`) [kg m].

    Attributes:
        distance: x, along the root tangent [m].
        values: phi_i [m].
        foreshortening: S, lower triangle [m]; empty with linear kinematics.
    """

    distance: Any
    values: Vector
    foreshortening: Vector


class DeformedPoint(NamedTuple):
    """A place of a link at its modal coordinates.

    Attributes:
        along: X [m].
        across: Y [m].
        foreshortening_gradient: S q, which is -dX/dq.
        values: phi_i, which is dY/dq.
    """

    along: Any
    across: Any
    foreshortening_gradient: Vector
    values: Vector


def bent(at: PointShape, q: Vector) -> DeformedPoint:
    """Return where a place of a link is at the modal coordinates q."""
    across = dot(at.values, q)
    if not at.foreshortening:
        return DeformedPoint(at.distance, across, [0.0] * len(q), at.values)
    foreshortening_gradient = symmetric_times(at.foreshortening, q)
    return DeformedPoint(
        at.distance - 0.5 * dot(q, foreshortening_gradient), across, foreshortening_gradient, at.values
    )


def velocity_acceleration(at: PointShape, point: DeformedPoint, rates: Vector, turn: Any) -> tuple[Any, Any]:
    """Return the components of a place's acceleration at v' = 0 along -e and -n, root tangent and normal [m/s^2].

    Args:
        at: the place.
        point: the same place of the bent link (`bent`).
        rates: modal rates [1/s].
        turn: angular velocity of the root tangent [rad/s].
    """
    turned, square = [2.0 * turn * rate for rate in rates], turn * turn
    along = dot(point.values, turned, point.along * square)
    across = dot(point.foreshortening_gradient, turned, point.across * square)
    return dot(at.foreshortening, products(rates), along) if at.foreshortening else along, across


class Link(NamedTuple):
    """Inertia of one link with what is fixed to it; all in kg m^2.

    Attributes:
        inertia: about the root, unbent.
        coupling: moment of inertia between root rotation and each mode, unbent.
        mass: modal mass matrix, lower triangle.
        centrifugal: the same without rotary inertias at the tip, which have no centrifugal effect, and less the
            integral of x S over mass, by which foreshortening brings mass closer to the root; lower triangle.
        cubic: T, for each mode a lower triangle; empty with linear kinematics.
        crossed: ``T_k,ji - T_j,ki`` for each two modes k > j, a number for each mode i; empty with linear kinematics.
        quartic: G, the lower triangle of a matrix over pairs of modes; empty with linear kinematics.
    """

    inertia: Any
    coupling: Vector
    mass: Vector
    centrifugal: Vector
    cubic: Vector
    crossed: Vector
    quartic: Vector


def root_inertia(link: Link, q: Vector) -> Any:
    """Return the moment of inertia of the bent link about its root."""
    bending, more = _spread(link, q)
    return dot(q, [x + 0.25 * y for x, y in zip(bending, more, strict=True)], link.inertia)


def centrifugal_forces(link: Link, q: Vector) -> list[Any]:
    """Return half the gradient of `root_inertia`: the modal forces of a unit centrifugal field."""
    bending, more = _spread(link, q)
    return [x + 0.5 * y for x, y in zip(bending, more, strict=True)]


def _spread(link: Link, q: Vector) -> tuple[list[Any], list[Any]]:
    """Return C q and Z q q, C the `centrifugal` matrix: a unit centrifugal field's modal forces are C q + Z q q / 2."""
    more = symmetric_times(_added_mass(link, q), q) if link.quartic else [0.0] * len(q)
    return symmetric_times(link.centrifugal, q), more


def root_coupling(link: Link, q: Vector) -> Vector:
    """Return the moment of inertia between root rotation and each mode of the bent link."""
    if not link.cubic:
        return link.coupling
    twice = _plus_crossed(link, q, q, symmetric_times(_cubic_times(link, q), q))
    return [own + 0.5 * more for own, more in zip(link.coupling, twice, strict=True)]


def modal_mass(link: Link, q: Vector) -> Vector:
    """Return the modal mass matrix of the bent link, lower triangle."""
    if not link.quartic:
        return link.mass
    return [own + added for own, added in zip(link.mass, _added_mass(link, q), strict=True)]


def velocity_forces(link: Link, q: Vector, rates: Vector, turn: Any) -> tuple[Any, list[Any]]:
    """Return the velocity forces of a link whose root does not move, on the root and on each mode, at v' = 0.

    `q`: modal coordinates, `rates`: theirs [1/s], `turn`: angular velocity of the root tangent [rad/s].
    """
    turned, square, out = [2.0 * turn * rate for rate in rates], turn * turn, centrifugal_forces(link, q)
    root: Any = 0.0
    modal: list[Any] = [0.0] * len(q)
    if link.quartic:
        pairs = products(rates)
        root = dot(_cubic_times(link, q), pairs)
        modal = _plus_crossed(link, q, turned, [dot(part, pairs) for part in _quartic_times(link, q)])
    return dot(out, turned, root), [own - square * force for own, force in zip(modal, out, strict=True)]


def kinetic_gradient(link: Link, q: Vector, rates: Vector, turn: Any) -> list[Any]:
    """Return the derivatives of a link's kinetic energy by q at constant rates, while its root does not move.

    Args: see `velocity_forces`.
    """
    out = centrifugal_forces(link, q)
    if not link.quartic:
        return [turn * (turn * force) for force in out]
    along = [dot(pair, rates) for pair in zip(*_quartic_times(link, q), strict=True)]
    turned = _plus_crossed(link, q, [-rate for rate in rates], symmetric_times(_cubic_times(link, q), rates))
    drawn = symmetric_times(along, rates)
    return [turn * (a + turn * b) + c for a, b, c in zip(turned, out, drawn, strict=True)]


def _cubic_times(link: Link, q: Vector) -> list[Any]:
    count = len(link.cubic) // len(q)
    return [dot(link.cubic[pair::count], q) for pair in range(count)]


def _plus_crossed(link: Link, q: Vector, b: Vector, start: Vector) -> list[Any]:
    """Return ``b^T A``, added to `start`."""
    n, result = len(q), list(start)
    for k in range(n):
        for j in range(k):
            first = n * (k * (k - 1) // 2 + j)
            skew = dot(link.crossed[first : first + n], q)
            result[j] = result[j] + b[k] * skew
            result[k] = result[k] - b[j] * skew
    return result


def _quartic_times(link: Link, q: Vector) -> list[list[Any]]:
    """Return Z_i of each mode i, lower triangle."""
    modes, pairs = range(len(q)), range(len(q) * (len(q) + 1) // 2)
    return [[dot([link.quartic[place(place(i, k), pair)] for k in modes], q) for pair in pairs] for i in modes]


def _added_mass(link: Link, q: Vector) -> list[Any]:
    """Return Z q, lower triangle: what foreshortening adds to the modal mass."""
    along, modes = _quartic_times(link, q), range(len(q))
    return [dot([along[i][place(j, k)] for k in modes], q) for i in modes for j in range(i + 1)]
