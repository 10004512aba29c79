"""The arm in finite elements: a plane frame of cubic Hermite beam elements that keep their length.

Every node of a link moves along x and y and turns. That elements keep their length, that the links meet at the elbow,
and that joints are locked are linear conditions; the motions that they allow are the null space of all of them. The
path from parameters to frequencies shares nothing with the package's equations nor with `tests.validation.beams`.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import block_diag, eigh, null_space

from flexarm_env import ArmParameters
from tests.validation.beams import Joints
from tests.validation.motion import Array

# of one element of length 1, in (v0, theta0, v1, theta1) across and (u0, u1) along it; consistent masses
BENDING = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]], dtype=float)
ACROSS = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) / 420.0
_ALONG = np.array([[2, 1], [1, 2]]) / 6.0


@dataclass(frozen=True)
class Frame:
    """Mass and stiffness of the unconstrained frame, and the conditions on its motions.

    Coordinates: x, y, turn of every node of link 1, then of link 2.
    """

    mass: Array  # Shape (n, n)
    stiffness: Array  # Shape (n, n)
    conditions: Array  # motions d that are possible have ``conditions @ d = 0``. Shape (c, n)

    def frequencies(self, count: int, zeros: int, motions: Array | None = None) -> Array:
        """Find the lowest natural frequencies above `zeros` at 0 [rad/s]. Shape (count,).

        With motions, shape (n, motions), the frame can move in these ways only.
        """
        basis = null_space(self.conditions) if motions is None else motions
        if np.abs(self.conditions @ basis).max() > 1e-9 * np.abs(basis).max():
            raise ValueError("motions: do not meet the frame's conditions")
        stiffness, mass = basis.T @ self.stiffness @ basis, basis.T @ self.mass @ basis
        squares = eigh(stiffness, mass, eigvals_only=True)
        return np.sqrt(squares[zeros : zeros + count])


def frame(parameters: ArmParameters, theta2: float, joints: Joints, elements: int) -> Frame:
    """Mesh the arm with straight links, link 1 along x, so many elements a link."""
    p = parameters
    columns = zip(p.link_lengths, p.flexural_rigidities, p.masses_per_length, (0.0, theta2), strict=True)
    matrices = [_link(length / elements, EI, rho, angle, elements) for length, EI, rho, angle in columns]
    mass, stiffness, lengths = (block_diag(*parts) for parts in zip(*matrices, strict=True))
    shoulder, tip, root, end = 0, 3 * elements, 3 * elements + 3, 6 * elements + 3
    for node, weight, inertia in (
        (shoulder, 0.0, p.shoulder_hub_inertia),
        (tip, p.elbow_mass, p.elbow_housing_inertia),
        (root, 0.0, p.elbow_hub_inertia),
        (end, p.payload_mass, p.payload_inertia),
    ):
        mass[range(node, node + 3), range(node, node + 3)] += (weight, weight, inertia)
    unit = np.eye(len(mass))
    conditions = [unit[0], unit[1], unit[tip] - unit[root], unit[tip + 1] - unit[root + 1]]
    conditions += [unit[2]] if joints.shoulder else []
    conditions += [unit[tip + 2] - unit[root + 2]] if joints.elbow else []
    return Frame(mass, stiffness, np.vstack([lengths, *conditions]))


def _link(h: float, rigidity: float, density: float, angle: float, elements: int) -> tuple[Array, Array, Array]:
    """Mass, stiffness and the conditions of constant length of one link."""
    cos, sin = np.cos(angle), np.sin(angle)
    turn = np.array([[-sin, cos, 0.0], [0.0, 0.0, h], [cos, sin, 0.0]])  # to across, turn times h, along
    to_local = block_diag(turn, turn)[[0, 1, 3, 4, 2, 5]]
    own_mass = to_local.T @ (density * h * block_diag(ACROSS, _ALONG)) @ to_local
    own_stiffness = to_local.T @ (rigidity / h**3 * block_diag(BENDING, np.zeros((2, 2)))) @ to_local
    n = 3 * elements + 3
    mass, stiffness, conditions = np.zeros((n, n)), np.zeros((n, n)), np.zeros((elements, n))
    for e in range(elements):
        at = slice(3 * e, 3 * e + 6)
        mass[at, at] += own_mass
        stiffness[at, at] += own_stiffness
        conditions[e, at] = to_local[5] - to_local[4]
    return mass, stiffness, conditions


def extrapolated(parameters: ArmParameters, theta2: float, joints: Joints, elements: int, count: int) -> Array:
    """Frequencies from two meshes, their error of fourth order removed (Richardson) [rad/s]. Shape (count,)."""
    coarse, fine = (
        frame(parameters, theta2, joints, n).frequencies(count, joints.free) for n in (elements, 2 * elements)
    )
    return fine + (fine - coarse) / 15.0


def shape_motions(
    parameters: ArmParameters,
    theta2: float,
    joints: Joints,
    shapes: tuple[tuple[Array, Array], tuple[Array, Array]],
) -> Array:
    """Motions of the frame's nodes when links bend in given shapes only. Shape (6 nodes, free joints + 2 m).

    Shapes are deflection and slope of each link off its root tangent at evenly spaced nodes. Shape (nodes, m) each.
    """
    p, nodes = parameters, len(shapes[0][0])
    x1, x2 = (np.linspace(0.0, length, nodes) for length in p.link_lengths)
    across = np.array([-np.sin(theta2), np.cos(theta2)])

    def motion(first: tuple[Array, Array], second: tuple[Array, Array]) -> Array:
        """From deflections and slopes of both links; link 2's are added to what link 1's tip does to it."""
        moves = np.zeros((2, nodes, 3))
        moves[0, :, 1], moves[0, :, 2] = first
        moves[1, :, :2] = moves[0, -1, :2] + second[0][:, None] * across
        moves[1, :, 2] = second[1]
        return moves.ravel()

    still = (np.zeros(nodes), np.zeros(nodes))
    turns = [] if joints.shoulder else [motion((x1, np.ones(nodes)), (x2, np.ones(nodes)))]
    turns += [] if joints.elbow else [motion(still, (x2, np.ones(nodes)))]
    (w1, s1), (w2, s2) = shapes
    # link 2's root tangent turns with link 1's tip: theta2 is measured from there
    bends = [motion((w1[:, i], s1[:, i]), (s1[-1, i] * x2, np.full(nodes, s1[-1, i]))) for i in range(w1.shape[1])]
    bends += [motion(still, (w2[:, i], s2[:, i])) for i in range(w2.shape[1])]
    return np.array([*turns, *bends]).T


def critical_spin(parameters: ArmParameters, elements: int = 20) -> float:
    """Return the spin at which the bare straight arm with free joints turns unstable in linear theory [rad/s].

    With angular momentum kept, the arm that spins at Omega has the potential U - Omega^2 I / 2 to second order, where I
    is its moment of inertia about the shoulder: at the spin where this ceases to be positive, straight spin is stable
    no more. Nothing couples by Coriolis forces, since to first order every point moves across. Linear theory has no
    foreshortening, so that deflections raise I and soften the arm; at a turned elbow, which is no deflection, I falls.
    Lumped masses are not counted.
    """
    p, (length_1, length_2) = parameters, parameters.link_lengths
    links = zip(p.link_lengths, p.masses_per_length, p.flexural_rigidities, strict=True)
    (mass_1, stiffness_1), (mass_2, stiffness_2) = (_beam(length, elements, *link) for length, *link in links)
    n = 2 * elements  # of deflection and slope at all nodes but the clamped one
    x = np.linspace(0.0, length_2, elements + 1)
    still, ones = np.zeros_like(x), np.ones_like(x)
    moved, turned = (np.column_stack(pair).ravel() for pair in ((ones, still), (x, ones)))
    # what moves link 2 across: link 1's tip, the absolute turn alpha of its root, its own deflection
    across = np.zeros((n + 2, 2 * n + 1))
    across[:, n - 2], across[:, n] = moved, turned
    across[2:, n + 1 :] = np.eye(n)
    rise = across.T @ mass_2 @ across  # half of I's second derivative
    rise[:n, :n] += mass_1[2:, 2:]
    # along the arm a point comes in by x alpha^2 / 2 + w alpha, at the distance L1 + x
    far = mass_2 @ (length_1 * moved + turned)
    rise[n, n] -= far @ turned
    rise[n, n + 1 :] -= far[2:]
    rise[n + 1 :, n] -= far[2:]
    stiffness = np.zeros((2 * n, 2 * n))
    stiffness[:n, :n], stiffness[n:, n:] = stiffness_1[2:, 2:], stiffness_2[2:, 2:]
    bends = np.delete(np.arange(2 * n + 1), n)  # alpha has no stiffness and takes its own balance
    softening = rise[np.ix_(bends, bends)] - np.outer(rise[bends, n], rise[n, bends]) / rise[n, n]
    return float(1.0 / np.sqrt(eigh(softening, stiffness, eigvals_only=True)[-1]))


def _beam(length: float, elements: int, rho: float, rigidity: float) -> tuple[Array, Array]:
    """Mass and stiffness across, in deflection and slope of every node. Shape (2 elements + 2,) twice each."""
    mass, stiffness, _ = _link(length / elements, rigidity, rho, 0.0, elements)
    across = np.flatnonzero(np.arange(len(mass)) % 3)
    return mass[np.ix_(across, across)], stiffness[np.ix_(across, across)]
