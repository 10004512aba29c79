"""Solves ``M v' = r`` of the linear arm by eliminating the modal coordinates, as plain functions (see `dynamics`).

With linear kinematics each link's modal block of M is constant: A of link 1 (with all that it carries) and B of
link 2. Only the elbow couples them, by a matrix of rank one, ``C mu phi^T``: C the cosine of a2 - a1, mu the modal
momenta of link 2, phi the modes of link 1 at the elbow. So both blocks are inverted once for an arm, A's correction
``A - C^2 (mu^T B^-1 mu) phi phi^T`` by one division (Sherman & Morrison 1950), and what is left for each state is a
2 x 2 system for the angular accelerations a1'' and a2'': two divisions, not one for each coordinate, and about half
the multiplications of a factorisation.

The price is digits with a heavy payload: A holds all that link 1 carries, and the correction takes most of it away
again. Without payload a solution is as good as a factorisation's, with 20 kg good to about 1e-10, with 1000 kg and four
modes to 1e-6 (`tests/physics/test_modal_elimination.py`).

c1 and c2 are the `coupling` of the links: moments of inertia between root rotation and modes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

from flexarm_env.physics import linear_algebra
from flexarm_env.physics.bent_link import root_inertia
from flexarm_env.physics.constants import Constants
from flexarm_env.physics.linear_algebra import Vector, dot, inverse, symmetric_times


class Elimination(NamedTuple):
    """The constants of the elimination; each field is a number or a tuple.

    Attributes:
        inv_A: A^-1, lower triangle.
        inv_B: B^-1, lower triangle.
        inv_A_phi: A^-1 phi, modal accelerations of link 1 by a unit force across its tip.
        inv_A_c1: A^-1 c1, by a unit angular acceleration of its root, reversed.
        inv_B_mu: B^-1 mu, of link 2 by a unit acceleration of the elbow across it, reversed.
        inv_B_c2: B^-1 c2, by a unit angular acceleration of its root, reversed.
        phi_inv_A_phi: phi^T A^-1 phi.
        phi_inv_A_c1: phi^T A^-1 c1.
        c1_inv_A_c1: c1^T A^-1 c1.
        mu_inv_B_mu: mu^T B^-1 mu.
        mu_inv_B_c2: mu^T B^-1 c2.
        c2_inv_B_c2: c2^T B^-1 c2.
    """

    inv_A: Vector
    inv_B: Vector
    inv_A_phi: Vector
    inv_A_c1: Vector
    inv_B_mu: Vector
    inv_B_c2: Vector
    phi_inv_A_phi: Any
    phi_inv_A_c1: Any
    c1_inv_A_c1: Any
    mu_inv_B_mu: Any
    mu_inv_B_c2: Any
    c2_inv_B_c2: Any

    @staticmethod
    def sizes(modes: int) -> list[int | None]:
        """Return the length of each field for a number of modes; None for a number."""
        return [modes * (modes + 1) // 2] * 2 + [modes] * 4 + [None] * 6

    def flat(self) -> list[Any]:
        """Return all numbers in order, as a kernel reads them."""
        return linear_algebra.flat(self)

    @classmethod
    def unflat(cls, numbers: Sequence[Any], modes: int) -> Elimination:
        """Return the inverse of `flat`."""
        return cls(*linear_algebra.unflat(numbers, cls.sizes(modes)))


def elimination(k: Constants) -> Elimination | None:
    """Invert the constant blocks of an arm with linear kinematics; None with foreshortened ones, which vary them."""
    if k.foreshortened:
        return None
    m = len(k.elbow_slopes)
    one, two = inverse(k.mass_1, m), inverse(k.mass_2, m)
    inv_A_phi, inv_A_c1 = symmetric_times(one, k.elbow_values), symmetric_times(one, k.coupling_1)
    inv_B_mu, inv_B_c2 = symmetric_times(two, k.momentum_2), symmetric_times(two, k.coupling_2)
    return Elimination(
        inv_A=one,
        inv_B=two,
        inv_A_phi=inv_A_phi,
        inv_A_c1=inv_A_c1,
        inv_B_mu=inv_B_mu,
        inv_B_c2=inv_B_c2,
        phi_inv_A_phi=dot(k.elbow_values, inv_A_phi),
        phi_inv_A_c1=dot(k.elbow_values, inv_A_c1),
        c1_inv_A_c1=dot(k.coupling_1, inv_A_c1),
        mu_inv_B_mu=dot(k.momentum_2, inv_B_mu),
        mu_inv_B_c2=dot(k.momentum_2, inv_B_c2),
        c2_inv_B_c2=dot(k.coupling_2, inv_B_c2),
    )


class Inertia(NamedTuple):
    """M at one posture of the arm, as the elimination leaves it; all numbers.

    Attributes:
        cos: C, cosine of a2 - a1.
        along: how far the elbow moves across link 2 with a unit turn of a1 [m].
        row_1_phi, row_2_phi: once q2 is eliminated, the rows of a1 and a2 in q1's columns are c1 - row_1_phi phi and
            row_2_phi phi.
        row_1_inv_A_phi, row_2_inv_A_phi: phi^T A^-1 times these rows.
        elbow_factor: factor on the elbow's response to a force across link 1, since link 2's modes give way.
        correction: what the correction of A adds to A^-1, in units of ``A^-1 phi phi^T A^-1``.
        schur_11, schur_12, schur_22: Schur complement of the modal blocks, what is left of M for a1 and a2.
        inverse_determinant: reciprocal of its determinant.
    """

    cos: Any
    along: Any
    row_1_phi: Any
    row_2_phi: Any
    row_1_inv_A_phi: Any
    row_2_inv_A_phi: Any
    elbow_factor: Any
    correction: Any
    schur_11: Any
    schur_12: Any
    schur_22: Any
    inverse_determinant: Any


def inertia(k: Constants, e: Elimination, y: Vector, cos: Any, sin: Any) -> Inertia:
    """Eliminate the modal coordinates from M(y); `e`: of the same arm, `cos`, `sin`: C and S of a2 - a1."""
    m = len(k.elbow_slopes)
    q1, q2 = y[1 : m + 1], y[m + 2 :]
    one, two = k.links
    softening = e.mu_inv_B_mu * cos * cos
    elbow_factor = 1.0 / (1.0 - softening * e.phi_inv_A_phi)
    correction = softening * elbow_factor
    swing, moment = dot(k.elbow_values, q1), dot(k.momentum_2, q2)
    along = k.elbow_distance * cos + swing * sin
    across = k.elbow_distance * sin - swing * cos
    rest = k.static_moment_2 - e.mu_inv_B_c2  # moment of link 2 when its modes give way
    row_1_phi, row_2_phi = e.mu_inv_B_mu * along * cos, rest * cos - moment * sin
    row_1_inv_A_phi, row_2_inv_A_phi = e.phi_inv_A_c1 - row_1_phi * e.phi_inv_A_phi, row_2_phi * e.phi_inv_A_phi
    schur_11 = root_inertia(one, q1) - e.c1_inv_A_c1 - e.mu_inv_B_mu * along * along
    schur_11 = (
        schur_11 + row_1_phi * (e.phi_inv_A_c1 + row_1_inv_A_phi) - correction * row_1_inv_A_phi * row_1_inv_A_phi
    )
    schur_12 = rest * along - moment * across - elbow_factor * row_2_phi * row_1_inv_A_phi
    schur_22 = root_inertia(two, q2) - e.c2_inv_B_c2 - elbow_factor * row_2_phi * row_2_inv_A_phi
    inverse_determinant = 1.0 / (schur_11 * schur_22 - schur_12 * schur_12)
    return Inertia(
        cos,
        along,
        row_1_phi,
        row_2_phi,
        row_1_inv_A_phi,
        row_2_inv_A_phi,
        elbow_factor,
        correction,
        schur_11,
        schur_12,
        schur_22,
        inverse_determinant,
    )


def solve(k: Constants, e: Elimination, at: Inertia, right: Vector) -> list[Any]:
    """Return x with ``M x = right``; arguments as in `inertia`, and its result."""
    m = len(k.elbow_slopes)
    free_1, free_2 = symmetric_times(e.inv_A, right[1 : m + 1]), symmetric_times(e.inv_B, right[m + 2 :])
    carried = dot(k.momentum_2, free_2)  # link 2's force on the elbow, across link 2
    reaction = at.cos * carried
    pushed = dot(k.elbow_values, free_1) - reaction * e.phi_inv_A_phi
    turned = dot(k.coupling_1, free_1) - reaction * e.phi_inv_A_c1
    on_1 = right[0] - at.along * carried - turned + (at.row_1_phi - at.correction * at.row_1_inv_A_phi) * pushed
    on_2 = right[m + 1] - dot(k.coupling_2, free_2) - at.elbow_factor * at.row_2_phi * pushed
    alpha_1 = at.inverse_determinant * (at.schur_22 * on_1 - at.schur_12 * on_2)
    alpha_2 = at.inverse_determinant * (at.schur_11 * on_2 - at.schur_12 * on_1)
    force = at.row_1_phi * alpha_1 - at.row_2_phi * alpha_2 - reaction
    force = force + at.correction * (pushed - at.row_1_inv_A_phi * alpha_1 - at.row_2_inv_A_phi * alpha_2)
    modal_1 = [free_1[i] - e.inv_A_c1[i] * alpha_1 + e.inv_A_phi[i] * force for i in range(m)]
    elbow = at.along * alpha_1 + at.cos * dot(k.elbow_values, modal_1)  # acceleration across link 2
    modal_2 = [free_2[i] - e.inv_B_mu[i] * elbow - e.inv_B_c2[i] * alpha_2 for i in range(m)]
    return [alpha_1, *modal_1, alpha_2, *modal_2]
