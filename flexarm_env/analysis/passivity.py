"""Hyperstability (Popov): positive realness of torque -> rate, over frequency.

From the torques to the collocated joint rates the linear resting arm is ``G(s) = s B^T (s^2 M + s D + K)^-1 B``. With
``v = (s^2 M + s D + K)^-1 B tau s``, the power that the torques feed in is

    tau^H (G + G^H) tau / 2 = v^H (Re(s) M + D + Re(s) / |s|^2 K) v >= 0   for Re(s) >= 0,

because M, D and K are not negative: positive real for every arm, mode count and pose. A negative feedback of the joint
rates through anything passive is therefore stable. None of this holds for a sensor away from the joint (another matrix
takes the place of the B^T on the left) or with a delay (a factor exp(-s T)).

Source: Popov, *Hyperstability of control systems*, Springer (1973); Khalil, *Nonlinear systems*, ch. 6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.analysis.operating_point import OperatingPoint
from flexarm_env.analysis.plant import Plant, linear_plant
from flexarm_env.analysis.sensor import Sensor, rigid_jacobian
from flexarm_env.validation import finite_array, instance, number, shown

Array = NDArray[np.float64]

FORCES = ("force x", "force y")


@dataclass(frozen=True, eq=False)
class Passivity:
    """Smallest eigenvalue of the Hermitian part of a transfer matrix, over frequency.

    Attributes:
        omega: [rad/s]. Shape (k,).
        smallest: smallest eigenvalue of (G + G^H) / 2, output unit per input unit. Shape (k,).
        relative: the same over the norm of G: -1 to 1. Shape (k,).
    """

    omega: Array
    smallest: Array
    relative: Array

    @property
    def worst(self) -> tuple[float, float]:
        """Smallest relative eigenvalue and its frequency [rad/s]."""
        index = int(np.argmin(self.relative))
        return float(self.relative[index]), float(self.omega[index])

    @property
    def is_positive_real(self) -> bool:
        """Nowhere negative beyond rounding, on the frequencies tried."""
        return self.worst[0] > -1e-9


def passivity(plant: Plant, omega: ArrayLike, growth: float = 0.0) -> Passivity:
    """Check a square plant for positive realness along a line of complex frequencies.

    Args:
        plant: its outputs must be rates, paired with its inputs (see `force_to_rate`).
        omega: [rad/s], > 0. Shape (k,).
        growth: real part of the complex frequency over omega, >= 0. An undamped arm is lossless, its Hermitian part 0
            on the imaginary axis: take a positive one for it.

    Raises:
        ValueError: for a plant that is not square, outputs that are no rates, or bad numbers.
    """
    instance("plant", plant, Plant)
    if not plant.is_square:
        raise ValueError(f"plant: {len(plant.inputs)} inputs and {len(plant.outputs)} outputs; they must be paired")
    if not all(sensor.rate for sensor in plant.sensors):
        raise ValueError(f"plant: its outputs {list(plant.outputs)} must be rates; take `sensor.rates()`")
    frequencies = finite_array("omega", omega, (None,))
    if not len(frequencies):
        raise ValueError("omega = []: must have one frequency at least [rad/s]")
    if np.any(frequencies <= 0.0):
        raise ValueError(f"omega = {float(frequencies.min())!r}: must be > 0 [rad/s]")
    slope = number("growth", growth, least=0.0)
    responses = np.array([plant.at(w * complex(slope, 1.0)) for w in frequencies])
    smallest = np.linalg.eigvalsh(0.5 * (responses + responses.conj().swapaxes(1, 2)))[:, 0]
    return Passivity(frequencies, smallest, smallest / np.linalg.norm(responses, 2, axis=(1, 2)))


def force_to_rate(point: OperatingPoint, sensor: Sensor) -> Plant:
    """Return the plant from the Cartesian force of the paper's law to the rate of the sensed point.

    The law (10) turns a force f at the sensed point into torques ``J^T f``. The power that f does on the *sensed* rate
    is power done on the arm only if that rate is ``J`` times the joint rates: for the rigid point without delay.

    Args:
        point: where the arm is.
        sensor: a rigid or true point of link 2.

    Raises:
        ValueError: for another sensor, or one off the link.
    """
    instance("point", point, OperatingPoint)
    instance("sensor", sensor, Sensor)
    if sensor.kind not in ("rigid point", "true point") or sensor.link != 2:
        raise ValueError(f"sensor = {shown(sensor)}: must be a rigid or true point of link 2")
    lengths = point.arm.parameters.link_lengths
    distance = lengths[1] if sensor.position is None else sensor.position
    transposed = rigid_jacobian(lengths[0], distance, point.q).T
    return linear_plant(point, sensor.rates()).driven_through(transposed, FORCES)
