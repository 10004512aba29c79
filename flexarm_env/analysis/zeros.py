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

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from flexarm_env.analysis.plant import Plant
from flexarm_env.validation import instance

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
# Smallest over largest singular value of the scaled input-output map below which it counts as singular. A double zero
# splits by about sqrt(eps / this value), with a few eps of rounding: so that it stays within `SAME`, ten of them.
RANK = 10.0 * float(np.finfo(float).eps) / SAME**2
EMPTY = 1e-10  # an output whose response is this small beside the others' does not move at all


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

    def distinct(self) -> list[tuple[complex, int]]:
        """Return each value once, with its algebraic multiplicity."""
        found: list[tuple[complex, int]] = []
        for value in self.values:
            if found and abs(found[-1][0] - value) <= 1e-12 * abs(value):
                found[-1] = (found[-1][0], found[-1][1] + 1)
            else:
                found.append((complex(value), 1))
        return found


def zeros(plant: Plant) -> Zeros:
    """Return the invariant zeros of a square plant; an exact delay adds none, its Pade model its own.

    Raises:
        ValueError: for a plant that is not square, or one whose input-output map has lost rank or nearly so: an
            arm that is straight or folded, or a point on link 1, under a Cartesian sensor.
    """
    instance("plant", plant, Plant)
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
        ValueError: with the sensor or the configuration that is at fault, and what would help.
    """
    rate, prompt = _scale(plant.A), replace(plant, delays=np.zeros_like(plant.delays))
    worst = 0.0
    for s in (0.31 + 0.47j, 0.83 + 0.59j):  # zeros at both of two arbitrary places would be a coincidence
        response = prompt.at(complex(s * rate))  # a delay scales an output, in the end to 0
        size = np.linalg.norm(response, axis=1, keepdims=True)
        largest = np.linalg.norm(response)
        if largest == 0.0 or np.any(size < EMPTY * largest):
            continue
        singular = np.linalg.svd(response / size, compute_uv=False)
        worst = max(worst, float(singular[-1] / singular[0]))
    if worst < RANK:
        raise ValueError(
            f"{_singular(plant)}: {list(plant.inputs)} cannot move {list(plant.outputs)} one by one, to the accuracy "
            f"that zeros need (smallest over largest singular value {worst:.1g}, at least {RANK:.1g})"
        )


def _singular(plant: Plant) -> str:
    """Say what is at fault, and what would help."""
    for sensor in plant.sensors:
        if sensor.kind.endswith("point") and (sensor.link == 1 or sensor.position == 0.0):
            return (
                f"sensor {sensor.place()}: it moves across link 1 only, in every configuration; take a point of link 2 "
                f"past the elbow, or `select` one output and one input"
            )
    sine = abs(float(np.sin(plant.point.q[1])))
    if sine < 1e-3 and any(sensor.kind.endswith("point") for sensor in plant.sensors):
        return f"singular configuration, {plant.point}: the arm is straight or folded; bend the elbow"
    places = sorted({sensor.place() for sensor in plant.sensors})
    return f"sensors {', '.join(places)} at {plant.point}: their readings depend on one another; take others"


@dataclass(frozen=True, eq=False)
class ZeroDirections:
    """What a zero blocks: ``G(z) input = 0`` and ``output^H G(z) = 0``.

    Attributes:
        input: torques (or other inputs) that leave the outputs at zero, of length 1 in the inputs' units [N m]. Shape
            (inputs,).
        output: combination of the outputs that no input moves, of length 1 in the reciprocal of the outputs' units.
            Shape (outputs,).
    """

    input: Complex
    output: Complex


def zero_directions(plant: Plant, zero: complex) -> ZeroDirections:
    """Return the input and output direction of a zero; real for a real zero.

    Args:
        plant: the plant.
        zero: a zero that is no pole [rad/s].

    Raises:
        ValueError: for a number that is not finite, or a pole: where a zero and a pole share a place, as at 0, the
            directions are not defined by the response.
    """
    instance("plant", plant, Plant)
    left, _, right = np.linalg.svd(plant.at(zero))
    u, y = (v * np.exp(-1j * np.angle(v[np.argmax(np.abs(v))])) for v in (right[-1].conj(), left[:, -1]))
    return ZeroDirections(u, y)


def _held_output(plant: Plant) -> Complex:
    """Return the poles of the arm with its output held; see the module's text."""
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
    """Return the generalised eigenvalues of [[A - s, B], [C, D]], balanced and scaled, time in fastest poles."""
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
    """Return the finite generalised eigenvalues of a - s b; `infinite`: distance from infinity that counts as such."""
    size_a, size_b = np.linalg.norm(a), np.linalg.norm(b)
    if size_b == 0.0 or size_a == 0.0:
        return np.zeros(0 if size_b == 0.0 else len(a), dtype=complex)
    alpha, beta = scipy.linalg.eig(a / size_a, b / size_b, right=False, homogeneous_eigvals=True)
    finite = np.abs(beta) > infinite * np.hypot(np.abs(alpha), np.abs(beta))
    return np.asarray(alpha[finite] / beta[finite] * (size_a / size_b), dtype=complex)


def _merge(values: Complex, origin: float) -> Complex:
    """Sort by magnitude, and replace clusters by their means."""
    left = values[np.lexsort((values.imag, values.real, np.abs(values)))]
    merged: list[complex] = []
    while len(left):
        near = np.abs(left - left[0]) <= max(SAME * abs(left[0]), origin)
        mean = complex(left[near].mean())
        merged += [mean if abs(mean) > origin else 0.0] * int(near.sum())
        left = left[~near]
    array = np.array(merged, dtype=complex)
    return np.where(np.abs(array.imag) <= 1e-9 * np.abs(array), array.real, array)


def _scale(a: Array) -> float:
    """Return the magnitude of the fastest pole [rad/s]."""
    return float(max(np.abs(np.linalg.eigvals(a)).max(), 1.0))
