"""Where an arm's lines are, for its picture."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.envs.settings import Settings
from flexarm_env.simulation.arm import FlexibleArm

Array = NDArray[np.float64]
POINTS = 24  # of a link's centre line


class Drawing(NamedTuple):
    """What a picture shows of an arm itself.

    Attributes:
        links: centre lines of link 1 and 2 [m]. Shape (n, 2) each.
        sensor: where the sensor on link 2 is [m]. Shape (2,).
    """

    links: tuple[Array, Array]
    sensor: Array


def drawing_of(settings: Settings, state: Array) -> Drawing:
    """Draw the arm of some settings in a public state, finite or not. Shape (4 + 4 m,)."""
    arm = settings.flexible_arm
    q = np.nan_to_num(state[: arm.size], posinf=0.0, neginf=0.0)
    return Drawing(centre_lines(arm, q), arm.position(q, 2, settings.sensor_position))


def centre_lines(arm: FlexibleArm, q: Array) -> tuple[Array, Array]:
    """Return points of the bent links, from root to tip [m]. Shape (n, 2) each.

    `q`: joint angles and modal coordinates. Shape (2 + 2 m,).
    """
    first, second = (
        arm.position(np.tile(q, (POINTS, 1)), link, np.linspace(0.0, length, POINTS))
        for link, length in enumerate(arm.parameters.link_lengths, 1)
    )
    return first, second
