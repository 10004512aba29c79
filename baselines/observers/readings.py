"""What the sensors deliver at the end of a control period."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexarm_baselines.arrays import Array, Floats

# Blocks of an observation that hold them: encoders and the late tip, and what strain gauges add.
SENSORS = ("joint_angles", "joint_rates", "sensed_position")
GAUGES = ("modal_coordinates", "modal_rates")


class Readings(NamedTuple):
    """Readings of n arms at one instant; a NaN is a reading that is missing.

    Attributes:
        joints: theta1, theta2 [rad] and their rates [rad/s], from the encoders. Shape (n, 4).
        tip: the late sensor's x, y in the world's frame [m]. Shape (n, 2).
        gauges: modal coordinates of link 1 and of link 2, and their rates, from strain gauges; None: there are none.
            Shape (n, 4 m).
    """

    joints: Array
    tip: Array
    gauges: Array | None = None


def fresh(tip: Floats, before: Floats) -> Floats:
    """Return the late tip's readings, with NaN for arms whose sensor holds the one before. Shape (n, 2).

    A sensor that lost a reading, or has none yet, delivers the last one again; a tip that moves never reads the same
    twice.

    Args:
        tip: readings that are delivered. Shape (n, 2).
        before: those of the control period before; NaN: there are none. Shape (n, 2).
    """
    return np.where((tip == before).all(axis=1)[:, None], np.nan, tip)
