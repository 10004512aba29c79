"""What is measured: a linear map of the coordinates' deviations, and how late it arrives.

A reading may be nonlinear in the coordinates; its Jacobian at the operating point is what the linear theory takes.

Source: Green & Sasiadek, *Control of a flexible robot using fuzzy logic and a noncollocated sensor*, IFAC 2008, (8),
(9) and (13), for the rigid point; the arm's own kinematics, `FlexibleArm.point_jacobian`, for the others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flexarm_env.analysis.operating_point import OperatingPoint
from flexarm_env.parameters import MAX_DELAY
from flexarm_env.physics import sensing
from flexarm_env.validation import choice, flag, integer, number

Array = NDArray[np.float64]

UNITS = {"joint angles": "rad", "strain": "1/m", "rigid point": "m", "true point": "m"}  # of readings, by kinds
# Largest change of a coordinate in the central difference that turns a Jacobian into its rate. The kinematics are
# smooth; with the extrapolation below the error is of fourth order, at rounding level.
_STEP = 1e-3


@dataclass(frozen=True)
class Sensor:
    """A sensor; see `joint_angles`, `strain`, `rigid_point`, `true_point`, `tip`.

    Attributes:
        kind: one of `UNITS`.
        link: 1 or 2; of strain and true points. A rigid point is on link 2.
        position: distance s from the link's root [m]; None: its tip. Of a rigid point the distance from the elbow.
        rate: the reading's rate of change instead of the reading.
        delay: [s].
    """

    kind: str
    link: int = 2
    position: float | None = None
    rate: bool = False
    delay: float = 0.0

    def __post_init__(self) -> None:
        choice("kind", self.kind, UNITS)
        integer("link", self.link, 1, 2)
        if self.kind == "rigid point" and self.link != 2:
            raise ValueError(f"link = {self.link}: a rigid point is on link 2; of link 1 take a true point")
        if self.kind == "joint angles" and (self.link, self.position) != (2, None):
            raise ValueError(f"link = {self.link}, position = {self.position}: joint angles have no place")
        if self.position is not None:
            object.__setattr__(self, "position", number("position", self.position, "m", least=0.0))
        flag("rate", self.rate)
        object.__setattr__(self, "delay", number("delay", self.delay, "s", least=0.0, most=MAX_DELAY))

    @property
    def unit(self) -> str:
        """Physical unit of a reading."""
        return UNITS[self.kind] + ("/s" if self.rate else "")

    def late(self, delay: float) -> Sensor:
        """Return the same sensor with another delay [s]."""
        return replace(self, delay=delay)

    def rates(self) -> Sensor:
        """Return the same sensor, read by its rate of change."""
        return replace(self, rate=True)

    def names(self) -> tuple[str, ...]:
        """Return the names of the outputs."""
        dot = "'" if self.rate else ""
        if self.kind == "joint angles":
            return f"theta1{dot}", f"theta2{dot}"
        if self.kind == "strain":
            return (f"curvature{dot} of link {self.link}",)
        return f"x{dot}", f"y{dot}"

    def place(self) -> str:
        """Describe what it is and where."""
        if self.kind == "joint angles":
            return self.kind
        return f"{self.kind} of link {self.link} at " + ("its tip" if self.position is None else f"{self.position:g} m")

    def matrix(self, point: OperatingPoint) -> Array:
        """Return C, which maps deviations of the state to those of the reading. Shape (outputs, 4 + 4 m)."""
        jacobian = self.jacobian(point, point.q)
        if not self.rate:
            return np.hstack([jacobian, np.zeros_like(jacobian)])
        # d(J q')/dq = sum_j d2(reading)/dq dq_j q'_j, which is the rate of J
        return np.hstack([self._jacobian_rate(point), jacobian])

    def jacobian(self, point: OperatingPoint, q: Array) -> Array:
        """Return d(reading)/dq at some coordinates of the point's arm. Shape (outputs, 2 + 2 m)."""
        if self.kind == "joint angles":
            return np.eye(2, len(q))
        place = self._place(point)
        if self.kind == "true point":
            return point.arm.point_jacobian(q, self.link, place)
        if self.kind == "rigid point":
            jacobian = rigid_jacobian(point.arm.parameters.link_lengths[0], place, q)
            return np.hstack([jacobian, np.zeros((2, len(q) - 2))])
        curvature = np.zeros((2, point.arm.parameters.modes_per_link))  # by the modal coordinates of each link
        curvature[self.link - 1] = point.arm.modes[self.link - 1].curvature(place)
        return np.concatenate([np.zeros(2), *curvature])[None]

    def _jacobian_rate(self, point: OperatingPoint) -> Array:
        def difference(step: float) -> Array:
            ahead = self.jacobian(point, point.q + step * point.rates)
            return (ahead - self.jacobian(point, point.q - step * point.rates)) / (2.0 * step)

        if point.at_rest:
            return np.zeros_like(self.jacobian(point, point.q))
        step = _STEP / float(np.abs(point.rates).max())
        return (4.0 * difference(0.5 * step) - difference(step)) / 3.0

    def _place(self, point: OperatingPoint) -> float:
        length = point.arm.parameters.link_lengths[self.link - 1]
        if self.position is None:
            return length
        if self.position > length:
            raise ValueError(f"position = {self.position} m: must be on link {self.link}, 0 to {length} [m]")
        return self.position


def rigid_jacobian(length_1: float, distance: float, q: Array) -> Array:
    """Return J of (13), with the cosine that the paper misprints.

    Args:
        length_1: L1 [m].
        distance: distance of the point from the elbow, L2 for the tip [m].
        q: coordinates, theta1 and theta2 first.

    Returns:
        d(x, y)/d(theta1, theta2) [m/rad]. Shape (2, 2).
    """
    one, both = ((np.sin(angle), np.cos(angle)) for angle in (q[0], q[0] + q[1]))
    return np.column_stack(sensing.rigid_jacobian(length_1, distance, one, both))


def joint_angles(*, rate: bool = False, delay: float = 0.0) -> Sensor:
    """Return encoders at both joints: theta1, theta2 [rad]; collocated with the torques."""
    return Sensor("joint angles", rate=rate, delay=delay)


def strain(link: int, position: float = 0.0, *, rate: bool = False, delay: float = 0.0) -> Sensor:
    """Return a strain gauge: the link's curvature w''(s) [1/m], which is proportional to strain."""
    return Sensor("strain", link, position, rate, delay)


def rigid_point(position: float | None = None, *, rate: bool = False, delay: float = 0.0) -> Sensor:
    """Return x, y of a point of link 2 by rigid kinematics of the joint angles [m] (8), (9): the paper's sensor."""
    return Sensor("rigid point", 2, position, rate, delay)


def true_point(position: float | None = None, link: int = 2, *, rate: bool = False, delay: float = 0.0) -> Sensor:
    """Return x, y of a material point with deflection [m]."""
    return Sensor("true point", link, position, rate, delay)


def tip(*, rate: bool = False, delay: float = 0.0) -> Sensor:
    """Return x, y of the true tip of link 2 [m]."""
    return Sensor("true point", rate=rate, delay=delay)
