"""Modal coordinates from strain gauges: those whose deflection fits that of an arm's links best.

Best means in the mean square over mass. On the arm whose coordinates they are, the fit gives these coordinates back.
A link's deflection w(s) is the integral over arc length of the angle between tangent and root tangent. It follows from
what strain gauges measure (w'' is the curvature), and w'(L) is then the tip's angle, as in the models.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.physics.link_modes import LinkModes
from flexarm_env.simulation.arm import FlexibleArm

Array = NDArray[np.float64]
PLACES = 41  # where a link's deflection is read, root and tip among them


def filters(arm: FlexibleArm) -> list[Array]:
    """Return each link's map from its deflection at `PLACES` [m] to a model's coordinates. Shape (m, PLACES) each."""
    places = np.linspace(0.0, 1.0, PLACES)
    weight = np.full(PLACES, 2.0 / 3.0)  # Simpson's rule
    weight[1::2], weight[[0, -1]] = 4.0 / 3.0, 1.0 / 3.0
    found = []
    for link in arm.modes:
        shapes = link.shape(link.length * places)
        weighted = shapes * weight[:, None]
        found.append(np.linalg.solve(weighted.T @ shapes, weighted.T))
    return found


class ChainGauges:
    """Reads a model's coordinates off a chain: everything is linear in the bend angles, and their rates.

    Attributes:
        modal: map of each link, from bend angles [rad] to modal coordinates. Shape (m, segments - 1) each.
        deflection: map of each link, from bend angles to the tip's deflection [m]. Shape (segments - 1,) each.
        bends: map of each link, from modal coordinates to bend angles, so that `modal` gives them back. Shape
            (segments - 1, m) each.
        elbow: what the model's shapes leave out of the slope of link 1's tip [rad], from its bend angles. Shape
            (segments - 1,).
    """

    def __init__(self, arm: FlexibleArm, segments: int) -> None:
        """Compute the maps.

        Args:
            arm: the model whose modal coordinates are read.
            segments: of each link of the chain.

        Raises:
            ValueError: for too few segments to tell the model's shapes apart.
        """
        least = arm.parameters.modes_per_link + 2
        if segments < least:
            raise ValueError(
                f"segments = {segments}: must be at least {least}, two more than the arm's modes_per_link, "
                "so that its bend angles tell the modes apart"
            )
        reads = [_deflections(link.length, segments) for link in arm.modes]
        self.modal = [f @ read for f, read in zip(filters(arm), reads, strict=True)]
        self.deflection = [read[-1] for read in reads]
        lifted = [_bends(link, segments) for link in arm.modes]
        self.bends = [lift @ np.linalg.inv(read @ lift) for read, lift in zip(self.modal, lifted, strict=True)]
        self.elbow = 1.0 - arm.modes[0].slope(arm.modes[0].length) @ self.modal[0]


def _deflections(length: float, segments: int) -> Array:
    """Return the map from a link's bend angles to its deflection at `PLACES` [m]. Shape (PLACES, segments - 1)."""
    elements = segments - 1
    middles = length * (0.5 + np.arange(elements)) / elements  # a hinge there lifts what comes after it
    places = np.linspace(0.0, length, PLACES)
    return np.maximum(places[:, None] - middles, 0.0)


def _bends(link: LinkModes, segments: int) -> Array:
    """Return the angles by which a bent link turns over each element [rad]. Shape (segments - 1, m)."""
    return np.diff(link.slope(np.linspace(0.0, link.length, segments)), axis=0)
