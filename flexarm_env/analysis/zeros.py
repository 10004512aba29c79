"""Invariant zeros of a square plant: the frequencies at which a torque leaves the sensor's reading at zero.

A position-like reading ``y = J q`` of the arm ``q'' = A21 q + A22 q' + B2 tau`` stays zero when ``q = N z`` (N spans
the null space of J), and W (which annihilates B2) eliminates the torque that this takes. What is left is the arm with
its output held, and the zeros are its poles:

    det W (s^2 - s A22 - A21) N = 0.

That is Rosenbrock's pencil with its infinite zeros deflated beforehand, in coordinates that make the mass matrix 1.
A resting arm without damping has A22 = 0: the pencil is then linear in s^2 and a zero lies on an axis exactly.
Everything else (rates as outputs, Pade models) goes through Rosenbrock's pencil itself.

Source: Emami-Naeini & Van Dooren, *Computation of zeros of linear multivariable systems*, Automatica 18 (1982).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from flexarm_env.analysis.plant import Plant

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

# A pencil's eigenvalue nearer to infinity than this, on the Riemann sphere with both matrices scaled to norm 1, counts
# as infinite. An infinite eigenvalue in a Jordan block of size k is computed at a distance of about eps^(1/k): 1.5e-8
# for k = 2 (the deflated pencil) and 6e-6 for k = 3 (Rosenbrock's, of relative degree 2).
INFINITE_DEFLATED = 1e-7
INFINITE_ROSENBROCK = 1e-4
# Zeros nearer to each other than this, relatively, count as one multiple zero. A defective double eigenvalue splits by
# about the root of the rounding error times its condition: below 1e-5 for the arms of this project.
SAME = 1e-4
# A zero smaller than this share of the fastest pole is one at the origin: there zeros are roots of rounding errors.
ORIGIN = 1e-7
# Smallest over largest singular value of the scaled input-output map below which it has lost rank.
RANK = 1e-10


@dataclass(frozen=True, eq=False)
class Zeros:
    """Finite invariant zeros of a plant.

    Attributes:
        values: [rad/s], by magnitude; each as often as its algebraic multiplicity. A cluster that rounding has split is
            replaced by its mean, whose error is that of a simple zero. Shape (k,).
        infinite: number of zeros at infinity, k + infinite = order of the plant.
    """

    values: Complex
    infinite: int

    @property
    def right_half_plane(self) -> Complex:
        """Those with a positive real part, beyond rounding. Shape (k',)."""
        return self.values[self.values.real > SAME * np.abs(self.values)]

    @property
    def on_axis(self) -> Complex:
        """Those on the imaginary axis, within rounding. Shape (k',)."""
        return self.values[np.abs(self.values.real) <= SAME * np.abs(self.values)]

    def distinct(self) -> list[tuple[complex, int]]:
        """Each value once, with its algebraic multiplicity."""
        found: list[tuple[complex, int]] = []
        for value in self.values:
            if found and abs(found[-1][0] - value) <= 1e-12 * abs(value):
                found[-1] = (found[-1][0], found[-1][1] + 1)
            else:
                found.append((complex(value), 1))
        return found


def zeros(plant: Plant) -> Zeros:
    """Invariant zeros of a square plant; an exact delay adds none, its Pade model its own.

    Args:
        plant: as many outputs as inputs.

    Returns:
        The finite zeros and the number of infinite ones.

    Raises:
        ValueError: for a plant that is not square, or one whose input-output map has lost rank (an arm that is straight
            or folded, under a Cartesian sensor), with the configuration.
    """
    if not plant.is_square:
        raise ValueError(
            f"plant: {len(plant.inputs)} inputs {list(plant.inputs)} and {len(plant.outputs)} outputs "
            f"{list(plant.outputs)}; zeros are computed for as many outputs as inputs"
        )
    check_rank(plant)
    half = plant.point.arm.size
    if plant.is_mechanical and not np.any(plant.C[:, half:]) and not np.any(plant.D):
        values = _held_output(plant)
    else:
        values = _rosenbrock(plant)
    merged = _merge(values, ORIGIN * _scale(plant.A))
    return Zeros(merged, len(plant.A) - len(merged))


def check_rank(plant: Plant) -> None:
    """Refuse a plant whose transfer matrix is singular at every frequency.

    Raises:
        ValueError: with the configuration.
    """
    rate = _scale(plant.A)
    worst = 0.0
    for s in (0.31 + 0.47j, 0.83 + 0.59j):  # zeros at both of two arbitrary places would be a coincidence
        response = plant.at(complex(s * rate)) * np.exp(s * rate * plant.delays)[:, None]
        size = np.linalg.norm(response, axis=1, keepdims=True)
        largest = np.linalg.norm(response)
        if largest == 0.0 or np.any(size < RANK * largest):
            continue
        singular = np.linalg.svd(response / size, compute_uv=False)
        worst = max(worst, float(singular[-1] / singular[0]))
    if worst < RANK:
        raise ValueError(
            f"singular configuration, {plant.point}: {list(plant.inputs)} cannot move {list(plant.outputs)} one by one"
        )


def zero_directions(plant: Plant, zero: complex) -> tuple[Complex, Complex]:
    """Input and output direction of a zero: ``G(z) u = 0`` and ``y^H G(z) = 0``.

    Args:
        plant: the plant.
        zero: a zero that is no pole.

    Returns:
        u, in the inputs' units, Shape (inputs,), and y, Shape (outputs,); both of length 1, and real for a real zero.
    """
    left, _, right = np.linalg.svd(plant.at(zero))
    u, y = right[-1].conj(), left[:, -1]
    u, y = (v * np.exp(-1j * np.angle(v[np.argmax(np.abs(v))])) for v in (u, y))
    return u, y


def _held_output(plant: Plant) -> Complex:
    """Poles of the arm with its output held; see the module's text."""
    half = plant.point.arm.size
    root = np.linalg.cholesky(plant.point.arm.mass_matrix(plant.point.q))
    unit = np.linalg.inv(root.T)  # q = unit x makes the mass matrix 1
    stiffness, damping = (root.T @ plant.A[half:, part] @ unit for part in (slice(0, half), slice(half, None)))
    output, action = plant.C[:, :half] @ unit, root.T @ plant.B[half:]
    n = scipy.linalg.null_space(output / np.linalg.norm(output, axis=1, keepdims=True))
    w = scipy.linalg.null_space((action / np.linalg.norm(action, axis=0)).T).T
    if n.shape[1] == 0:
        return np.zeros(0, dtype=complex)
    a, b, lead = w @ stiffness @ n, w @ damping @ n, w @ n
    if not np.any(np.abs(plant.A[half:, half:]) > 1e-12 * _scale(plant.A)):
        squares = _merge(_finite(a, lead, INFINITE_DEFLATED), (ORIGIN * _scale(plant.A)) ** 2)
        squares = np.where(np.abs(squares.imag) <= SAME * np.abs(squares), squares.real, squares)
        roots = np.sqrt(squares.astype(complex))
        return np.concatenate([roots, -roots])
    size = len(a)
    rate = float(np.sqrt(np.linalg.norm(a) / np.linalg.norm(lead)))
    eye, nothing = np.eye(size), np.zeros((size, size))
    first = np.block([[nothing, eye], [a / rate**2, b / rate]])
    second = np.block([[eye, nothing], [nothing, lead]])
    return rate * _finite(first, second, INFINITE_DEFLATED)


def _rosenbrock(plant: Plant) -> Complex:
    """Generalised eigenvalues of [[A - s, B], [C, D]], balanced, inputs and outputs scaled, time in fastest poles."""
    rate = _scale(plant.A)
    balanced, change = scipy.linalg.matrix_balance(plant.A / rate, permute=False)
    b, c = np.linalg.solve(change, plant.B) / rate, plant.C @ change
    inputs = np.linalg.norm(b, axis=0)
    outputs = np.linalg.norm(np.hstack([c, plant.D / inputs]), axis=1, keepdims=True)
    n, p = plant.B.shape
    first = np.block([[balanced, b / inputs], [c / outputs, plant.D / inputs / outputs]])
    second = np.zeros((n + p, n + p))
    second[:n, :n] = np.eye(n)
    return rate * _finite(first, second, INFINITE_ROSENBROCK)


def _finite(a: Array, b: Array, infinite: float) -> Complex:
    """Finite generalised eigenvalues of a - s b.

    Args:
        a: Shape (n, n).
        b: Shape (n, n).
        infinite: distance from infinity that counts as infinite.
    """
    size_a, size_b = np.linalg.norm(a), np.linalg.norm(b)
    if size_b == 0.0 or size_a == 0.0:
        return np.zeros(0 if size_b == 0.0 else len(a), dtype=complex)
    alpha, beta = scipy.linalg.eig(a / size_a, b / size_b, right=False, homogeneous_eigvals=True)
    finite = np.abs(beta) > infinite * np.hypot(np.abs(alpha), np.abs(beta))
    return np.asarray(alpha[finite] / beta[finite] * (size_a / size_b), dtype=complex)


def _merge(values: Complex, origin: float) -> Complex:
    """Sorted by magnitude, clusters replaced by their means.

    Args:
        values: computed eigenvalues.
        origin: magnitude that counts as zero.
    """
    left = list(values[np.lexsort((values.imag, values.real, np.abs(values)))])
    merged: list[complex] = []
    while left:
        reach = max(SAME * abs(left[0]), origin)
        near = [abs(value - left[0]) <= reach for value in left]
        cluster = [value for value, close in zip(left, near, strict=True) if close]
        left = [value for value, close in zip(left, near, strict=True) if not close]
        mean = sum(cluster) / len(cluster)
        merged += [mean if abs(mean) > origin else 0.0] * len(cluster)
    array = np.array(merged, dtype=complex)
    return np.where(np.abs(array.imag) <= 1e-9 * np.abs(array), array.real, array)


def _scale(a: Array) -> float:
    """Magnitude of the fastest pole [rad/s]."""
    return float(max(np.abs(np.linalg.eigvals(a)).max(), 1.0))
