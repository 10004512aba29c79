"""One bent link in the frame of its root tangent, as plain functions of numbers (see `dynamics`).

A point at the distance x along the link lies at (X, Y) = (x - u, w): ``w = sum_i phi_i(x) q_i`` (3), and the
foreshortening ``u = q^T S(x) q / 2``, where ``S_ij(x)`` is the integral of phi_i' phi_j' from the root to x.
``w'`` is the angle of the link's tangent against the root's, so that bending energy, joint angles and the angles of
hubs are those of an inextensible beam, X is right to second order in q, and Y lacks only terms of third order.
With linear kinematics S is left out (its sequences are empty) and nothing of it is recorded.

Source: Kane, Ryan & Banerjee, *Dynamics of a cantilever beam attached to a moving base*, J. Guidance 10 (1987), on why
a spinning beam needs it and how it enters; the integrals over two links and the kernels' form of them are our own.

T and G are the moments of the foreshortening: ``T_k,ij`` integral of phi_k S_ij, ``G_ij,kl`` of S_ij S_kl over mass.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from flexarm_env.physics.linear_algebra import Vector, dot, place, products, symmetric_times


class PointShape(NamedTuple):
    """A point of a link, or the sum of its mass over points (then with a moment for each distance).

    Attributes:
        distance: x, along the root tangent [m].
        values: phi_i.
        foreshortening: S, lower triangle; empty with linear kinematics.
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


def foreshortening_acceleration(at: PointShape, rates: Vector) -> Any:
    """Return the acceleration of a place towards the root that the modal rates alone cause, q'^T S q'."""
    return dot(at.foreshortening, products(rates)) if at.foreshortening else 0.0


class Link(NamedTuple):
    """Inertia of one link with what is fixed to it.

    Attributes:
        inertia: about the root, unbent [kg m^2].
        coupling: moment of inertia between root rotation and each mode, unbent.
        mass: modal mass matrix, lower triangle.
        translation: the same without rotary inertias at the tip, which have no centrifugal effect.
        shortened: integral of x S over mass, lower triangle; empty with linear kinematics, as are:
        cubic: T, for each mode a lower triangle.
        quartic: G, the lower triangle of a matrix over pairs of modes.
    """

    inertia: Any
    coupling: Vector
    mass: Vector
    translation: Vector
    shortened: Vector
    cubic: Vector
    quartic: Vector


def root_inertia(link: Link, q: Vector) -> Any:
    """Return the moment of inertia of the bent link about its root."""
    bending, more = _spread(link, q)
    return link.inertia + dot(q, [x + 0.25 * y for x, y in zip(bending, more, strict=True)])


def centrifugal_forces(link: Link, q: Vector) -> list[Any]:
    """Return half the gradient of `root_inertia`: the modal forces of a unit centrifugal field."""
    bending, more = _spread(link, q)
    return [x + 0.5 * y for x, y in zip(bending, more, strict=True)]


def _spread(link: Link, q: Vector) -> tuple[list[Any], list[Any]]:
    """Return A q and B q: the mass matrix less what foreshortening takes away, and what it squared adds."""
    if not link.quartic:
        return symmetric_times(link.translation, q), [0.0] * len(q)
    left = [mass - shortened for mass, shortened in zip(link.translation, link.shortened, strict=True)]
    return symmetric_times(left, q), symmetric_times(symmetric_times(link.quartic, products(q)), q)


def root_coupling(link: Link, q: Vector) -> Vector:
    """Return the moment of inertia between root rotation and each mode of the bent link."""
    if not link.cubic:
        return link.coupling
    bent_by = _cubic_times(link, q)
    pulled = [dot(q, column) for column in zip(*bent_by, strict=True)]
    return [link.coupling[j] + (pulled[j] - 0.5 * dot(bent_by[j], q)) for j in range(len(q))]


def modal_mass(link: Link, q: Vector) -> Vector:
    """Return the modal mass matrix of the bent link, lower triangle."""
    if not link.quartic:
        return link.mass
    modes, result = range(len(q)), []
    for i in modes:
        for j in range(i + 1):
            total = link.mass[place(i, j)]
            for k in modes:
                for n in range(k + 1):  # both orders of two modes at once
                    one, other = (link.quartic[place(place(i, a), place(j, b))] for a, b in ((k, n), (n, k)))
                    if k == n:
                        total = total + one * (q[k] * q[k])
                    elif i == j:
                        total = total + one * (2.0 * (q[k] * q[n]))
                    else:
                        total = total + (one + other) * (q[k] * q[n])
            result.append(total)
    return result


def shortening_forces(link: Link, q: Vector, rates: Vector, turn: Any) -> tuple[Any, Vector]:
    """Return the velocity forces that foreshortening adds, on the root and on each mode, at v' = 0.

    Args:
        link: the link.
        q: modal coordinates.
        rates: rates of the coordinates.
        turn: angular velocity of the root tangent.
    """
    n = len(q)
    if not link.quartic:
        return 0.0, [0.0] * n
    pairs, bent_by = products(rates), _cubic_times(link, q)
    root = dot(q, [dot(_cubic(link, k, n), pairs) for k in range(n)])
    across = [dot(rates, column) for column in zip(*bent_by, strict=True)]
    along = symmetric_times(symmetric_times(link.quartic, pairs), q)
    return root, [2.0 * turn * (across[j] - dot(rates, bent_by[j])) + along[j] for j in range(n)]


def _cubic(link: Link, mode: int, modes: int) -> Vector:
    """Return T_k of one mode, lower triangle."""
    count = modes * (modes + 1) // 2
    return link.cubic[mode * count : (mode + 1) * count]


def _cubic_times(link: Link, q: Vector) -> list[list[Any]]:
    """Return T_k q of each mode k."""
    return [symmetric_times(_cubic(link, k, len(q)), q) for k in range(len(q))]
