"""The arm derived a second time, for the tests: from the positions of its material points alone.

Nothing of the package's mechanics is used. The coordinates are the public ones, the shapes are the textbook's
(Blevins 1979, table 8-1), integrals over the links are Clenshaw-Curtis sums, and every derivative is automatic.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import mpmath
import numpy as np
import torch
from hypothesis import strategies as st
from torch.func import grad, jacrev, vjp

from flexarm_env import ArmParameters
from flexarm_env.physics.damping import clamped_ratio, material_time

NODES = 65  # the fastest integrand turns 2 * 11 rad over a link: 65 nodes leave rounding error only


def textbook_roots(count: int) -> list[float]:
    """Of cos z cosh z = -1, to 30 digits before rounding."""
    with mpmath.workdps(30):
        guesses = [1.875, 4.694, 7.855, 10.996]
        return [float(mpmath.findroot(lambda z: mpmath.cos(z) * mpmath.cosh(z) + 1, g)) for g in guesses[:count]]


def clenshaw_curtis(length: float, count: int = NODES) -> tuple[np.ndarray, np.ndarray]:
    """Nodes and weights on [0, length]."""
    n = count - 1
    angle = np.pi * np.arange(count) / n
    j = np.arange(1, n // 2 + 1)
    factor = np.where(j == n // 2, 1.0, 2.0) / (4.0 * j**2 - 1.0)
    weights = (1.0 - np.cos(2.0 * np.outer(angle, j)) @ factor) * np.where(np.arange(count) % n == 0, 1.0, 2.0) / n
    return 0.5 * length * (1.0 - np.cos(angle)), 0.5 * length * weights


def shapes(p: ArmParameters, length: float, x: Any, order: int = 0) -> np.ndarray:
    """Return the derivative of the shapes at x."""
    return (_cantilever if p.mode_shapes == "cantilever" else _polynomial)(p, length, np.asarray(x), order)


def _polynomial(p: ArmParameters, length: float, x: np.ndarray, order: int) -> np.ndarray:
    """Ritz modes of the clamped-free beam from the monomials (x/L)^n, n = 2 ... m + 1."""
    n = np.arange(2, p.modes_per_link + 2)
    vectors = monomial_ritz(p.modes_per_link)  # whose sum is the value at the tip
    vectors = vectors * (2.0 * p.mode_scale * (-1.0) ** np.arange(len(n)) / vectors.sum(axis=0))
    falling = np.array([np.prod(power - np.arange(order)) for power in n])
    return falling * (x[..., None] / length) ** np.maximum(n - order, 0) @ vectors / length**order


@lru_cache
def monomial_ritz(count: int) -> np.ndarray:
    """Coefficients of (x/L)^2 ... in each mode: exact integrals, 30 digits, since monomials are nearly alike."""
    n = range(2, count + 2)
    with mpmath.workdps(30):
        mass = mpmath.matrix([[mpmath.mpf(1) / (i + j + 1) for j in n] for i in n])
        bending = mpmath.matrix([[mpmath.mpf(i * (i - 1) * j * (j - 1)) / (i + j - 3) for j in n] for i in n])
        inverse = mpmath.inverse(mpmath.cholesky(mass))
        _, vectors = mpmath.eigsy(inverse * bending * inverse.T)
        return np.array((inverse.T * vectors).tolist(), dtype=float)


def _cantilever(p: ArmParameters, length: float, x: np.ndarray, order: int) -> np.ndarray:
    """cosh - cos - sigma (sinh - sin), sigma = (sinh - sin)/(cosh + cos)."""
    z = np.array(textbook_roots(p.modes_per_link))
    sigma = (np.sinh(z) - np.sin(z)) / (np.cosh(z) + np.cos(z))
    u = x[..., None] * z / length
    hyperbolic = (np.cosh, np.sinh)[order % 2](u) - sigma * (np.sinh, np.cosh)[order % 2](u)
    shifted = u + order * np.pi / 2  # the order-th derivatives of cos and sin
    return p.mode_scale * (z / length) ** order * (hyperbolic - np.cos(shifted) + sigma * np.sin(shifted))


def tensor(values: Any) -> torch.Tensor:
    return torch.tensor(np.asarray(values), dtype=torch.float64)


def push_forward(function: Any, q: torch.Tensor, v: torch.Tensor) -> Any:
    """d(function)/dq v: the pull-back is linear in what it pulls back, and its own pull-back pushes forward.

    (torch's forward mode would do, but warns of torch's own deprecations.)
    """
    values, pull_back = vjp(function, q)
    zeros = tuple(torch.zeros_like(value) for value in values)
    return vjp(lambda *cotangent: pull_back(cotangent)[0], *zeros)[1](v)


class Lagrangian:
    """Energies of the arm as functions of (theta1, theta2, q1, q2), and the equations that follow from them."""

    def __init__(self, p: ArmParameters) -> None:
        self.p, self.m = p, p.modes_per_link
        self.x, self.phi, self.tip, self.tip_slope, density = [], [], [], [], []
        self.bends = []  # slopes between the root and each point, and the weights of their integral
        self.stiffness = []  # of each link: EI times the integral of phi'' phi''
        self.modal_mass = []
        for length, rigidity, rho in zip(p.link_lengths, p.flexural_rigidities, p.masses_per_length, strict=True):
            x, weight = clenshaw_curtis(length)
            self.x.append(tensor(x))
            self.phi.append(tensor(shapes(p, length, x)))
            self.tip.append(tensor(shapes(p, length, length)))
            self.tip_slope.append(tensor(shapes(p, length, length, 1)))
            to, parts = clenshaw_curtis(1.0)
            points = np.append(x, length)
            self.bends.append((tensor(shapes(p, length, points[:, None] * to, 1)), tensor(points[:, None] * parts)))
            density.append(rho * weight)
            bend = shapes(p, length, x, 2)
            self.stiffness.append(rigidity * bend.T @ (weight[:, None] * bend))
            self.modal_mass.append(rho * weight @ shapes(p, length, x) ** 2)
        self.masses = tensor(np.concatenate([*density, [p.elbow_mass, p.payload_mass]]))
        elbow = p.elbow_housing_inertia, p.elbow_hub_inertia
        self.inertias = tensor([p.shoulder_hub_inertia, *elbow, p.payload_inertia])

    def configuration(self, q: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
        """Positions of all masses, Shape (points, 2), and angles of all rotary inertias."""
        q1, q2 = q[2 : 2 + self.m], q[2 + self.m :]
        a1 = q[0]
        a2 = a1 + self.tip_slope[0] @ q1 + q[1]

        def along(angle: torch.Tensor, x: torch.Tensor, w: torch.Tensor) -> torch.Tensor:
            c, s = torch.cos(angle), torch.sin(angle)
            return torch.stack([x * c - w * s, x * s + w * c], dim=-1)

        length1, length2 = (tensor(length) for length in self.p.link_lengths)
        drawn1, drawn2 = self.foreshortening(0, q1), self.foreshortening(1, q2)
        elbow = along(a1, length1 - drawn1[-1], self.tip[0] @ q1)
        first = along(a1, self.x[0] - drawn1[:-1], self.phi[0] @ q1)
        second = elbow + along(a2, self.x[1] - drawn2[:-1], self.phi[1] @ q2)
        tip = elbow + along(a2, length2 - drawn2[-1], self.tip[1] @ q2)
        points = torch.cat([first, second, elbow[None], tip[None]])
        return points, torch.stack([a1, a2 - q[1], a2, a2 + self.tip_slope[1] @ q2])

    def foreshortening(self, link: int, q: torch.Tensor) -> torch.Tensor:
        """Foreshortening of a link's points and of its tip: half the integral of the squared slope from the root."""
        slopes, weights = self.bends[link]
        foreshortened = self.p.kinematics == "foreshortened"
        return 0.5 * foreshortened * (weights * (slopes @ q) ** 2).sum(dim=-1)

    def kinetic(self, q: torch.Tensor, v: torch.Tensor) -> torch.Tensor:
        velocities, turns = push_forward(self.configuration, q, v)
        return 0.5 * (self.masses @ (velocities**2).sum(dim=-1) + self.inertias @ turns**2)

    def strain(self, q: torch.Tensor) -> torch.Tensor:
        parts = (q[2 : 2 + self.m], q[2 + self.m :])
        return 0.5 * sum(part @ tensor(k) @ part for part, k in zip(parts, self.stiffness, strict=True))

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        at, zero = tensor(q), torch.zeros(len(q), dtype=torch.float64)
        return jacrev(grad(self.kinetic, argnums=1), argnums=1)(at, zero).numpy()

    def velocity_forces(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """d(dT/dv)/dq v - dT/dq."""
        at, rates = tensor(q), tensor(v)
        drift = jacrev(grad(self.kinetic, argnums=1))(at, rates) @ rates
        return (drift - grad(self.kinetic)(at, rates)).numpy()

    def passive_forces(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """K q + D v and friction, as they stand on the left-hand side."""
        p = self.p
        omega = [np.sqrt(np.diag(k) / mass) for k, mass in zip(self.stiffness, self.modal_mass, strict=True)]
        if p.damping_model == "modal":
            damping = [2.0 * clamped_ratio(p) * w * mass for w, mass in zip(omega, self.modal_mass, strict=True)]
        else:
            damping = [material_time(p) * np.diag(k) for k in self.stiffness]
        dissipation = np.concatenate([p.joint_friction, *damping]) * v
        dissipation[:2] += self.dry_friction(v[:2])
        return grad(self.strain)(tensor(q)).numpy() + dissipation

    def dry_friction(self, rates: np.ndarray) -> np.ndarray:
        """Stribeck's curve times the sine of the angle whose tangent is the rate over the smoothing."""
        p = self.p
        left = p.stribeck_velocity**2 / (p.stribeck_velocity**2 + rates**2)
        level = np.array(p.coulomb_friction) + left * p.breakaway_excess
        return level * np.sin(np.arctan2(rates, p.friction_smoothing))

    def acceleration(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        """Return the generalised forces: the torques work on the joint angles alone."""
        torque = np.concatenate([tau, np.zeros(2 * self.m)])
        right = torque - self.velocity_forces(q, v) - self.passive_forces(q, v)
        return np.linalg.solve(self.mass_matrix(q), right)


DRY: dict[str, Any] = {"coulomb_friction": (4.0, 1.5), "breakaway_excess": (3.0, 0.5)}
DRY |= {"stribeck_velocity": 0.4, "friction_smoothing": 0.2}


def loaded_arm(modes: int, **changes: Any) -> ArmParameters:
    """Unequal links, every lumped mass, damping and friction: no term can hide."""
    values: dict[str, Any] = {
        "link_lengths": (4.5, 3.7),
        "flexural_rigidities": (1676.0, 1100.0),
        "masses_per_length": (0.335, 0.29),
        "modes_per_link": modes,
        "shoulder_hub_inertia": 1.3,
        "elbow_hub_inertia": 0.4,
        "elbow_mass": 0.7,
        "payload_mass": 0.5,
        "payload_inertia": 0.25,
        "damping_ratio": 0.02,
        "joint_friction": (0.6, 0.35),
        "mode_scale": 0.17,
    }
    return ArmParameters.linear(**(values | changes))


@st.composite
def arms(draw: st.DrawFn) -> ArmParameters:
    """Any arm whose links differ by less than a factor of about ten in each respect."""

    def two(low: float, high: float) -> tuple[float, float]:
        return draw(st.tuples(st.floats(low, high), st.floats(low, high)))

    kinds = [("complete", "linear"), ("rigid", "linear"), ("complete", "foreshortened")]
    forces, kinematics = draw(st.sampled_from(kinds))
    lumped = ["shoulder_hub_inertia", "elbow_hub_inertia", "elbow_mass", "payload_mass", "payload_inertia"]
    lumped += ["elbow_housing_inertia"] if kinematics == "foreshortened" else []
    return ArmParameters.linear(
        link_lengths=two(1.0, 9.0),
        flexural_rigidities=two(500.0, 5000.0),
        masses_per_length=two(0.1, 1.0),
        modes_per_link=draw(st.integers(1, 4)),
        **{name: draw(st.floats(0.0, 5.0)) for name in lumped},
        damping_ratio=draw(st.floats(0.0, 1.0)),
        damping_model=draw(st.sampled_from(["modal", "material"])),
        joint_friction=two(0.0, 5.0),
        **draw(st.sampled_from([{}, DRY])),
        velocity_forces=forces,
        mode_scale=draw(st.floats(0.05, 2.0)),
        kinematics=kinematics,
        mode_shapes=draw(st.sampled_from(["cantilever", "polynomial"])),
    )


def random_state(p: ArmParameters, seed: int, deflection: float = 0.5, rate: float = 3.0) -> np.ndarray:
    """Any angles; tip deflections of about `deflection` [m] from each mode, tip speeds of about `rate` [m/s]."""
    rng = np.random.default_rng(seed)
    m = p.modes_per_link
    scale = 2.0 * p.mode_scale  # a mode's tip value
    q = np.concatenate([rng.uniform(-np.pi, np.pi, 2), rng.normal(size=2 * m) * deflection / scale])
    v = np.concatenate([rng.normal(size=2) * rate, rng.normal(size=2 * m) * rate / scale])
    return np.concatenate([q, v])


def random_states(p: ArmParameters, count: int) -> Iterator[np.ndarray]:
    return (random_state(p, seed) for seed in range(count))
