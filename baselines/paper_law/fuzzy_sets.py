"""Triangular fuzzy sets and the linguistic variables built from them.

Symbols: ``x`` a value of the variable, ``mu`` in [0, 1] its degree of membership in a set. A variable's
universe is the interval on which it is defined; its sets may reach past the ends, only the part inside
counts.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from flexarm_baselines.arrays import Floats
from flexarm_baselines.paper_law.fuzzy_kernels import membership
from flexarm_env.validation import number


@dataclass(frozen=True)
class TriangularSet:
    """A triangle of height 1: zero outside (left, right), one at ``peak``.

    ``left == peak`` or ``peak == right`` makes a shoulder with a vertical edge; both at once is refused.

    Args:
        left: where membership starts, in the variable's unit.
        peak: where membership is 1.
        right: where membership ends.
    """

    left: float
    peak: float
    right: float

    def __post_init__(self) -> None:
        for name in ("left", "peak", "right"):
            number(name, getattr(self, name))
        if not (self.left <= self.peak <= self.right and self.left < self.right):
            raise ValueError(f"{self}: must have left <= peak <= right and left < right")

    def membership(self, x: ArrayLike) -> Floats:
        """Return mu at the values x, in [0, 1]; shape of ``x``."""
        values = np.asarray(x, dtype=np.float64)
        degrees = [membership(value, self.left, self.peak, self.right) for value in values.ravel().tolist()]
        return np.array(degrees).reshape(values.shape)


@dataclass(frozen=True)
class FuzzyVariable:
    """A named variable: its universe and the sets that describe it.

    Args:
        name: what errors call the variable.
        universe: (low, high), in the variable's unit.
        sets: at least one set.
    """

    name: str
    universe: tuple[float, float]
    sets: tuple[TriangularSet, ...]

    def __post_init__(self) -> None:
        low, high = self.universe
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise ValueError(f"universe of {self.name} = {self.universe}: must be finite, low < high")
        if not self.sets:
            raise ValueError(f"sets of {self.name} = (): must hold at least one TriangularSet")

    @property
    def corners(self) -> Floats:
        """Rows (left, peak, right), one per set, shape ``(m, 3)``."""
        return np.array([(s.left, s.peak, s.right) for s in self.sets], dtype=np.float64)

    def check_cover(self) -> None:
        """Check that every value of the universe belongs to some set, so that a rule fires at every input.

        Raises:
            ValueError: at a value, which the message names, all memberships are zero.
        """
        low, high = self.universe
        knots = np.unique(np.clip([*self.corners.ravel(), low, high], low, high))
        # Between two neighbouring knots a membership is either positive throughout or zero throughout, so the
        # knots and one point between each two of them decide for the whole universe.
        for x in sorted([*knots, *(0.5 * (knots[1:] + knots[:-1]))]):
            if not any(membership(x, s.left, s.peak, s.right) > 0.0 for s in self.sets):
                raise ValueError(
                    f"sets of {self.name}: must cover [{low}, {high}], but all memberships are zero at {x:g}"
                )

    def check_order(self) -> None:
        """Check that the sets are listed from left to right, so that one sweep finds their union.

        Raises:
            ValueError: a left end or a peak lies left of that of the set before.
        """
        for corner, values in zip(("left", "peak"), self.corners[:, :2].T, strict=True):
            if np.any(np.diff(values) < 0.0):
                raise ValueError(f"{corner} of {self.name}'s sets = {values.tolist()}: must not step back")

    def check_areas(self) -> None:
        """Check that every set has an area inside the universe, so that a centroid exists.

        Raises:
            ValueError: a set touches the universe in one point, or not at all.
        """
        low, high = self.universe
        for member in self.sets:
            if max(member.left, low) >= min(member.right, high):
                raise ValueError(f"sets of {self.name}: {member} must have an area inside [{low}, {high}]")
