"""The package's arm in small motion about rest: its frequencies, by shapes and joints that are locked."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import eigh

from flexarm_env import ArmParameters, FlexibleArm
from flexarm_env.parameters import ModeShapes
from tests.validation.conftest import Check
from tests.validation.motion import Array

BARE = ArmParameters.linear(damping_ratio=0.0)
PAYLOAD: dict[str, Any] = {"payload_mass": 0.5, "payload_inertia": 0.1}
# link 2 differs from the paper's, so that no length, rigidity or density can stand for another
UNEQUAL: dict[str, Any] = {
    "link_lengths": (4.5, 3.1),
    "flexural_rigidities": (1676.0, 830.0),
    "masses_per_length": (0.335, 0.21),
}
MODES = (1, 2, 3, 4)
BASES: tuple[ModeShapes, ...] = ("cantilever", "polynomial")  # the shapes that a link may bend in
SHAPES = [(basis, modes) for basis in BASES for modes in MODES]
COUNT = 4  # frequencies that are compared


class Case(NamedTuple):
    """Frequencies of one problem [rad/s]."""

    exact: Array  # of the beams
    found: Mapping[tuple[str, int], Array]  # of the package, by shapes and their number; fewer if it has no more

    def errors(self, basis: str, modes: int) -> Array:
        """Return found over exact, minus 1."""
        found = self.found[basis, modes]
        return found / self.exact[: len(found)] - 1.0

    @property
    def least_error(self) -> float:
        """The smallest error of any shapes."""
        return min(float(self.errors(*shapes).min()) for shapes in SHAPES)

    @property
    def growth(self) -> float:
        """The largest growth of a frequency with one more mode, relative."""
        pairs = [(self.found[b, m], self.found[b, m + 1]) for b, m in SHAPES if m < MODES[-1]]
        return max(float((more[: len(fewer)] / fewer - 1.0).max()) for fewer, more in pairs)


def rayleigh_and_ritz(least: str, cases: Callable[[], Iterable[Case]], rounding: str) -> tuple[Check, Check]:
    """Return the checks of the bounds on errors, by the name of the first one, and on growth."""
    reason = f"(rounding {rounding})"
    return (
        Check(
            least,
            lambda: min(case.least_error for case in cases()),
            f"Rayleigh and Ritz: a model of fewer shapes is stiffer, its frequencies are upper bounds {reason}",
            least=-float(rounding),
        ),
        Check(
            "largest growth of a frequency with one more mode",
            lambda: max(case.growth for case in cases()),
            f"Rayleigh and Ritz: one more shape can only lower every frequency {reason}",
            most=float(rounding),
        ),
    )


@cache
def with_shapes(parameters: ArmParameters, basis: ModeShapes, modes: int) -> FlexibleArm:
    """Make the same arm, undamped, in so many shapes a link."""
    return FlexibleArm(replace(parameters, modes_per_link=modes, damping_ratio=0.0, mode_shapes=basis))


def frequencies(arm: FlexibleArm, theta2: float, moving: Sequence[int], zeros: int) -> Array:
    """Return the lowest `COUNT` frequencies above `zeros` at 0 [rad/s]; all that does not move is held."""
    mass, stiffness = _at_rest(arm, theta2)
    free = np.ix_(moving, moving)
    squares = eigh(0.5 * (stiffness + stiffness.T)[free], mass[free], eigvals_only=True)
    return np.sqrt(squares[zeros : zeros + COUNT])


@cache
def _at_rest(arm: FlexibleArm, theta2: float) -> tuple[Array, Array]:
    """Mass and stiffness of the straight arm."""
    n, state = arm.size, np.zeros(2 * arm.size)
    state[1] = theta2
    mass = arm.mass_matrix(state[:n])
    return mass, -mass @ arm.linearise(state).A[n:, :n]


def rate(sizes: ArrayLike, errors: ArrayLike) -> float:
    """Return p of ``error ~ size^-p``, by least squares on logarithms."""
    slope, _ = np.polynomial.polynomial.polyfit(np.log(sizes), np.log(errors), 1)[::-1]
    return -float(slope)
