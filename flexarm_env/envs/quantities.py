"""Quantities of an episode that kernels know: allowed ranges, own values, and what a reset may request.

`kernels.entries.Drawn` has their places, meanings and units.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from flexarm_env.kernels.entries import DRAWN
from flexarm_env.parameters import HEAVIEST_PAYLOAD, LARGEST_NOISE, MAX_DELAY

# What all arms of a batch share.
SHARED_BY_ARMS = ("link_lengths", "modes_per_link", "mode_shapes", "mode_scale", "kinematics", "velocity_forces")


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """Declaration of a quantity of an episode.

    Attributes:
        least: lowest end of a range.
        most: highest end of a range.
        own: function of `Settings` that returns its value if it is neither drawn nor requested.
        least_requested: lowest value that a reset may request; None: the lower one of own value and range.
        most_requested: highest value that a reset may request; None: the higher one of own value and range, for which
            memory, integration step and bounds are laid out.
    """

    least: float = 0.0
    most: float
    own: Callable[[Any], float]
    least_requested: float | None = 0.0
    most_requested: float | None = None


QUANTITIES: dict[str, Quantity] = {
    "delay": Quantity(most=MAX_DELAY, own=lambda s: max(s.sensor_delays)),
    "payload_mass": Quantity(
        most=HEAVIEST_PAYLOAD,
        own=lambda s: s.flexible_arm.parameters.payload_mass,
        least_requested=None,
        most_requested=HEAVIEST_PAYLOAD,  # a heavier arm is a slower one
    ),
    "stiffness": Quantity(least=0.1, most=10.0, own=lambda s: 1.0, least_requested=1e-3),
    "damping": Quantity(most=1.0, own=lambda s: s.flexible_arm.parameters.damping_ratio),
    "noise": Quantity(most=LARGEST_NOISE, own=lambda s: s.noise),
    "actuation_delay": Quantity(most=MAX_DELAY, own=lambda s: s.actuation_delay),
}
assert tuple(QUANTITIES) == tuple(DRAWN)  # in the kernels' order


def orderable(settings: Any, name: str) -> tuple[float, float]:
    """Return the least and the largest value of a quantity that a reset may request."""
    quantity, own = QUANTITIES[name], settings.own_value(name)
    if name == "actuation_delay" and settings.mode.shifts:  # whole periods only
        return own, own
    low, high = settings.range_of(name)
    least, most = quantity.least_requested, quantity.most_requested
    return min(low, own) if least is None else least, max(high, own) if most is None else most
