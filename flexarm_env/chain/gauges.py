"""What strain gauges tell of an arm: the modal coordinates whose deflection fits that of its links best.

Best means in the mean square over mass. On the arm whose coordinates they are, the fit gives these coordinates back.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.chain.links import PLACES, Bend
from flexarm_env.physics.link_modes import LinkModes
from flexarm_env.simulation.arm import FlexibleArm

Array = NDArray[np.float64]


class Gauges:
    """Reads a model's coordinates off any arm: the deflection that they can express, in the mean square over mass.

    Attributes:
        arm: the model.
        filters: map of each link, from deflections at `PLACES` to coordinates. Shape (m, PLACES) each.
    """

    def __init__(self, arm: FlexibleArm) -> None:
        """For the coordinates of a model."""
        self.arm = arm
        places = np.linspace(0.0, 1.0, PLACES)
        weight = np.full(PLACES, 2.0 / 3.0)  # Simpson's rule
        weight[1::2], weight[[0, -1]] = 4.0 / 3.0, 1.0 / 3.0
        self.filters = []
        for link in arm.modes:
            shapes = link.shape(link.length * places)
            weighted = shapes * weight[:, None]
            self.filters.append(np.linalg.solve(weighted.T @ shapes, weighted.T))

    def modal(self, bend: Bend) -> tuple[Array, Array]:
        """Modal coordinates and rates of both links. Shape (2, m) each."""
        read = [np.array([f @ w for f, w in zip(self.filters, part, strict=True)]) for part in bend[2:]]
        return read[0], read[1]

    def state(self, bend: Bend) -> Array:
        """Public state of the model. Shape (4 + 4 m,)."""
        q, rates = self.modal(bend)
        y, v = (np.concatenate([[a[0]], x[0], [a[1]], x[1]]) for a, x in ((bend.roots, q), (bend.root_rates, rates)))
        return self.arm.public_state(np.concatenate([y, v]))


class ChainGauges:
    """The same on a chain, as matrices: everything is linear in the bend angles, and their rates.

    Attributes:
        modal: map of each link, from bend angles [rad] to modal coordinates. Shape (m, segments - 1) each.
        deflection: map of each link, from bend angles to the tip's deflection [m]. Shape (segments - 1,) each.
        bends: map of each link, from modal coordinates to bend angles, so that `modal` gives them back. Shape
            (segments - 1, m) each.
        elbow: what the model's shapes leave out of the slope of link 1's tip [rad], from its bend angles. Shape
            (segments - 1,).
    """

    def __init__(self, arm: FlexibleArm, segments: int) -> None:
        """For the coordinates of a model, on a chain with so many segments a link.

        Raises:
            ValueError: for fewer segments than the model's shapes can be told apart with.
        """
        least = arm.parameters.modes_per_link + 2
        if segments < least:
            raise ValueError(
                f"segments = {segments}: must be at least {least}, two more than the arm's modes_per_link, "
                "so that its bend angles tell the modes apart"
            )
        filters = Gauges(arm).filters
        reads = [_deflections(link.length, segments) for link in arm.modes]
        self.modal = [f @ read for f, read in zip(filters, reads, strict=True)]
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
