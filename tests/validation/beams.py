"""Natural frequencies of uniform Euler-Bernoulli beams from their exact, transcendental equations.

Small motion about a straight arm at rest, joints free to turn or locked. A beam's *dynamic stiffness* gives the end
forces that hold given end motions at frequency omega, exactly; frequencies are where the assembled matrix D(omega) is
singular. The count of Wittrick and Williams (Q. J. Mech. Appl. Math. 24, 1971) is the number of frequencies below any
omega, so that bisection finds every one of them, coincident ones too.

Symbols: v, theta displacement across the beam and slope at an end; b = lambda L, lambda^4 = rho omega^2 / EI.
Nothing here comes from the package but the arm's parameters.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from flexarm_env import ArmParameters
from tests.validation.motion import Array


@dataclass(frozen=True)
class Joints:
    shoulder: bool  # locked
    elbow: bool  # locked

    @property
    def free(self) -> int:
        """Number of free joints: so many motions without bending, at frequency 0."""
        return 2 - self.shoulder - self.elbow


@dataclass(frozen=True)
class Beam:
    length: float  # L [m]
    rigidity: float  # EI [N m^2]
    density: float  # rho [kg/m]

    def phase(self, omega: float) -> float:
        """b = lambda L at a frequency [rad/s]."""
        return self.length * (self.density * omega**2 / self.rigidity) ** 0.25

    def frequency(self, b: float) -> float:
        """[rad/s] at a phase b: inverse of `phase`."""
        return (b / self.length) ** 2 * (self.rigidity / self.density) ** 0.5


def links(parameters: ArmParameters) -> tuple[Beam, Beam]:
    p = parameters
    columns = (p.link_lengths, p.flexural_rigidities, p.masses_per_length)
    one, two = (Beam(*values) for values in zip(*columns, strict=True))
    return one, two


def clamped_free(beam: Beam, count: int) -> Array:
    """Roots of ``cos b cosh b = -1`` as frequencies [rad/s]. Shape (count,)."""
    return _roots(beam, lambda b: np.cos(b) + 1.0 / np.cosh(b), range(count))


def pinned_free(beam: Beam, count: int) -> Array:
    """Roots of ``tan b = tanh b`` above 0 as frequencies [rad/s]. Shape (count,)."""
    return _roots(beam, lambda b: np.sin(b) - np.cos(b) * np.tanh(b), range(1, count + 1))


def _roots(beam: Beam, equation: Callable[[float], float], halves: range) -> Array:
    ends = [(i * np.pi, (i + 1) * np.pi) for i in halves]
    return np.array([beam.frequency(brentq(equation, *pair, xtol=1e-15, rtol=1e-15)) for pair in ends])


def clamped_free_shapes(count: int, x: Array) -> tuple[Array, Array]:
    """Shapes (2 at the tip) and slopes of a beam of length 1, without cancellation. Shape (len(x), count) each."""
    b = np.sqrt(clamped_free(Beam(1.0, 1.0, 1.0), count))
    u = x[:, None] * b
    k = (np.cos(b) + np.cosh(b)) / (np.sin(b) + np.sinh(b))
    rest = (np.sin(b) - np.cos(b) - np.exp(-b)) / (np.sin(b) + np.sinh(b))  # 1 - k
    shape = np.exp(-u) + rest * np.sinh(u) - np.cos(u) + k * np.sin(u)
    slope = b * (-np.exp(-u) + rest * np.cosh(u) + np.sin(u) + k * np.cos(u))
    return shape, slope


def dynamic_stiffness(beam: Beam, omega: float) -> Array:
    """Return end forces and moments over motions (v0, theta0, vL, thetaL) at a frequency. Shape (4, 4)."""
    b = beam.phase(omega)
    scale = 1.0 / np.cosh(b)  # numerators and denominator over cosh b: no overflow
    sin, cos, sinh = np.sin(b), np.cos(b), np.tanh(b)
    d = (scale - cos) / b  # (1 - cos b cosh b) / (b cosh b)
    vv, vt = b**2 * (cos * sinh + sin) / d, b * sin * sinh / d
    vw, vs = -(b**2) * (sin * scale + sinh) / d, b * (1.0 - cos * scale) / d
    tt, ts = (sin - cos * sinh) / d, (sinh - sin * scale) / d
    matrix = np.array([[vv, vt, vw, vs], [vt, tt, -vs, ts], [vw, -vs, vv, -vt], [vs, ts, -vt, tt]])
    units = np.array([1.0, beam.length, 1.0, beam.length])
    return beam.rigidity / beam.length**3 * matrix * np.outer(units, units)


def held_count(beam: Beam, omega: float) -> int:
    """How many frequencies of the beam with both ends held lie below omega."""
    b = beam.phase(omega)
    half_waves = int(b / np.pi)
    sign = np.sign(1.0 / np.cosh(b) - np.cos(b))
    return half_waves - int(0.5 * (1.0 - (-1.0) ** half_waves * sign))


@dataclass(frozen=True)
class Structure:
    """Beams whose ends follow common coordinates, with lumped masses."""

    # each beam, and the matrix that gives its end motions (v0, theta0, vL, thetaL) from the n coordinates
    parts: tuple[tuple[Beam, Array], ...]
    mass: Array  # mass matrix of what is lumped. Shape (n, n)

    def below(self, omega: float) -> int:
        """How many natural frequencies, zeros included, lie below omega [rad/s] > 0."""
        matrix = -(omega**2) * self.mass
        for beam, ends in self.parts:
            matrix = matrix + ends.T @ dynamic_stiffness(beam, omega) @ ends
        negative = int((np.linalg.eigvalsh(matrix) < 0.0).sum())
        return negative + sum(held_count(beam, omega) for beam, _ in self.parts)

    def frequencies(self, count: int, zeros: int = 0) -> Array:
        """Find the lowest natural frequencies above `zeros` at 0 [rad/s]. Shape (count,)."""
        found = []
        for index in range(zeros, zeros + count):
            low, high = 0.0, 1.0
            while self.below(high) <= index:
                low, high = high, 2.0 * high
            while high - low > 4e-15 * high:
                middle = 0.5 * (low + high)
                low, high = (middle, high) if self.below(middle) <= index else (low, middle)
            found.append(0.5 * (low + high))
        return np.array(found)


def single_link(beam: Beam, pinned: bool, hub: float = 0.0, payload: tuple[float, float] = (0.0, 0.0)) -> Structure:
    """One link on a fixed root; hub [kg m^2] turns with the root, payload [kg, kg m^2] is at the tip."""
    columns = [1, 2, 3] if pinned else [2, 3]
    lumped = np.diag([0.0, hub, *payload])
    return Structure(((beam, np.eye(4)[:, columns]),), lumped[np.ix_(columns, columns)])


def two_links(parameters: ArmParameters, theta2: float, joints: Joints) -> Structure:
    """Assemble the arm about rest, straight links, elbow at theta2 [rad].

    Links keep their length. So the elbow moves across link 1 only, by v, which is v cos theta2 across link 2's root;
    along link 2, v sin theta2 moves its whole mass and the payload.
    """
    p = parameters
    one, two = links(p)
    shoulder, elbow, tip_slope, root_slope, tip, payload_slope = np.eye(6)
    still = np.zeros(6)
    along = (two.density * two.length + p.payload_mass) * np.sin(theta2) ** 2
    elbow_masses = p.elbow_mass + along, p.elbow_housing_inertia, p.elbow_hub_inertia
    mass = np.diag([p.shoulder_hub_inertia, *elbow_masses, p.payload_mass, p.payload_inertia])
    first = np.array([still, shoulder, elbow, tip_slope])
    second = np.array([np.cos(theta2) * elbow, root_slope, tip, payload_slope])
    allowed = [] if joints.shoulder else [shoulder]
    allowed += [tip_slope + root_slope] if joints.elbow else [tip_slope, root_slope]
    basis = np.array([*allowed, elbow, tip, payload_slope]).T
    return Structure(((one, first @ basis), (two, second @ basis)), basis.T @ mass @ basis)
