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
        inverse_1: A^-1, lower triangle.
        inverse_2: B^-1, lower triangle.
        push_1: A^-1 phi, modal accelerations of link 1 by a unit force across its tip.
        turn_1: A^-1 c1, by a unit angular acceleration of its root, reversed.
        push_2: B^-1 mu, of link 2 by a unit acceleration of the elbow across it, reversed.
        turn_2: B^-1 c2, by a unit angular acceleration of its root, reversed.
        push_push_1: phi^T A^-1 phi.
        push_turn_1: phi^T A^-1 c1.
        turn_turn_1: c1^T A^-1 c1.
        push_push_2: mu^T B^-1 mu.
        push_turn_2: mu^T B^-1 c2.
        turn_turn_2: c2^T B^-1 c2.
    """

    inverse_1: Vector
    inverse_2: Vector
    push_1: Vector
    turn_1: Vector
    push_2: Vector
    turn_2: Vector
    push_push_1: Any
    push_turn_1: Any
    turn_turn_1: Any
    push_push_2: Any
    push_turn_2: Any
    turn_turn_2: Any

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
    push_1, turn_1 = symmetric_times(one, k.elbow_values), symmetric_times(one, k.coupling_1)
    push_2, turn_2 = symmetric_times(two, k.momentum_2), symmetric_times(two, k.coupling_2)
    return Elimination(
        inverse_1=one,
        inverse_2=two,
        push_1=push_1,
        turn_1=turn_1,
        push_2=push_2,
        turn_2=turn_2,
        push_push_1=dot(k.elbow_values, push_1),
        push_turn_1=dot(k.elbow_values, turn_1),
        turn_turn_1=dot(k.coupling_1, turn_1),
        push_push_2=dot(k.momentum_2, push_2),
        push_turn_2=dot(k.momentum_2, turn_2),
        turn_turn_2=dot(k.coupling_2, turn_2),
    )


class Inertia(NamedTuple):
    """M at one posture of the arm, as the elimination leaves it; all numbers.

    Attributes:
        cos: C, cosine of a2 - a1.
        along: how far the elbow moves across link 2 with a unit turn of a1 [m].
        drag, pull: the rows of a1 and a2 in q1's columns once q2 is eliminated are c1 - drag phi and pull phi.
        first, second: phi^T A^-1 times these rows.
        grown: factor on the elbow's response to a force across link 1, since link 2's modes give way.
        extra: what the correction of A adds to A^-1, in units of ``A^-1 phi phi^T A^-1``.
        left_11, left_12, left_22: what is left of M for a1 and a2.
        scale: reciprocal of its determinant.
    """

    cos: Any
    along: Any
    drag: Any
    pull: Any
    first: Any
    second: Any
    grown: Any
    extra: Any
    left_11: Any
    left_12: Any
    left_22: Any
    scale: Any


def inertia(k: Constants, e: Elimination, y: Vector, cos: Any, sin: Any) -> Inertia:
    """Eliminate the modal coordinates from M(y).

    Args:
        k: constants.
        e: elimination of the same arm.
        y: internal coordinates.
        cos: C, cosine of a2 - a1.
        sin: S, sine of a2 - a1.
    """
    m = len(k.elbow_slopes)
    q1, q2 = y[1 : m + 1], y[m + 2 :]
    one, two = k.links
    softening = e.push_push_2 * cos * cos
    grown = 1.0 / (1.0 - softening * e.push_push_1)
    extra = softening * grown
    swing, moment = dot(k.elbow_values, q1), dot(k.momentum_2, q2)
    along = k.elbow_distance * cos + swing * sin
    across = k.elbow_distance * sin - swing * cos
    rest = k.static_moment_2 - e.push_turn_2  # moment of link 2 when its modes give way
    drag, pull = e.push_push_2 * along * cos, rest * cos - moment * sin
    first, second = e.push_turn_1 - drag * e.push_push_1, pull * e.push_push_1
    left_11 = root_inertia(one, q1) - e.turn_turn_1 - e.push_push_2 * along * along
    left_11 = left_11 + drag * (e.push_turn_1 + first) - extra * first * first
    left_12 = rest * along - moment * across - grown * pull * first
    left_22 = root_inertia(two, q2) - e.turn_turn_2 - grown * pull * second
    scale = 1.0 / (left_11 * left_22 - left_12 * left_12)
    return Inertia(cos, along, drag, pull, first, second, grown, extra, left_11, left_12, left_22, scale)


def solve(k: Constants, e: Elimination, at: Inertia, right: Vector) -> list[Any]:
    """Return x with ``M x = right``; arguments as in `inertia`, and its result."""
    m = len(k.elbow_slopes)
    free_1, free_2 = symmetric_times(e.inverse_1, right[1 : m + 1]), symmetric_times(e.inverse_2, right[m + 2 :])
    carried = dot(k.momentum_2, free_2)  # link 2's force on the elbow, across link 2
    reaction = at.cos * carried
    pushed = dot(k.elbow_values, free_1) - reaction * e.push_push_1
    turned = dot(k.coupling_1, free_1) - reaction * e.push_turn_1
    on_1 = right[0] - at.along * carried - turned + (at.drag - at.extra * at.first) * pushed
    on_2 = right[m + 1] - dot(k.coupling_2, free_2) - at.grown * at.pull * pushed
    turn_1 = at.scale * (at.left_22 * on_1 - at.left_12 * on_2)
    turn_2 = at.scale * (at.left_11 * on_2 - at.left_12 * on_1)
    force = at.drag * turn_1 - at.pull * turn_2 - reaction
    force = force + at.extra * (pushed - at.first * turn_1 - at.second * turn_2)
    modal_1 = [free_1[i] - e.turn_1[i] * turn_1 + e.push_1[i] * force for i in range(m)]
    elbow = at.along * turn_1 + at.cos * dot(k.elbow_values, modal_1)  # acceleration across link 2
    modal_2 = [free_2[i] - e.push_2[i] * elbow - e.turn_2[i] * turn_2 for i in range(m)]
    return [turn_1, *modal_1, turn_2, *modal_2]
