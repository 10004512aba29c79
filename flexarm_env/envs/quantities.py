"""Quantities that may be drawn for each episode: allowed ranges, own values, and what a reset may request.

`kernels.entries.Drawn` has their places, meanings and units.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from flexarm_env.kernels.entries import DRAWN
from flexarm_env.parameters import HEAVIEST_PAYLOAD, LARGEST_NOISE, MAX_DELAY
from flexarm_env.validation import mapping, pair, shown


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """Declaration of a quantity of an episode.

    Attributes:
        note: unit or meaning, beside its name in the documentation.
        least: lowest end of a range.
        most: highest end of a range.
        own: function of `Settings` that returns its value if it is neither drawn nor requested.
        least_requested: lowest value that a reset may request; None: the lower one of own value and range.
        most_requested: highest value that a reset may request; None: the higher one of own value and range, for which
            memory, integration step and bounds are laid out.
    """

    note: str
    least: float = 0.0
    most: float
    own: Callable[[Any], float]
    least_requested: float | None = 0.0
    most_requested: float | None = None


QUANTITIES: dict[str, Quantity] = {
    "delay": Quantity(note="[s] (both joints)", most=MAX_DELAY, own=lambda s: max(s.sensor_delays)),
    "payload_mass": Quantity(
        note="[kg]",
        most=HEAVIEST_PAYLOAD,
        own=lambda s: s.flexible_arm.parameters.payload_mass,
        least_requested=None,
        most_requested=HEAVIEST_PAYLOAD,  # a heavier arm is a slower one
    ),
    "stiffness": Quantity(note="(factor)", least=0.1, most=10.0, own=lambda s: 1.0, least_requested=1e-3),
    "damping": Quantity(
        note="(ratio of the free arm's first elastic mode)",
        most=1.0,
        own=lambda s: s.flexible_arm.parameters.damping_ratio,
    ),
    "noise": Quantity(note="[m]", most=LARGEST_NOISE, own=lambda s: s.noise),
    "actuation_delay": Quantity(note="[s]", most=MAX_DELAY, own=lambda s: s.actuation_delay),
}
assert tuple(QUANTITIES) == tuple(DRAWN)  # in the kernels' order
NAMED_QUANTITIES = ", ".join(f"`{name}` {quantity.note}" for name, quantity in QUANTITIES.items())


def orderable(settings: Any, name: str) -> tuple[float, float]:
    """Return the least and the largest value of a quantity that a reset may request.

    Args:
        settings: `Settings`.
        name: name of the quantity.
    """
    quantity, own = QUANTITIES[name], settings.own_value(name)
    if name == "actuation_delay" and settings.mode.shifts:  # whole periods only
        return own, own
    low, high = settings.range_of(name)
    least, most = quantity.least_requested, quantity.most_requested
    return min(low, own) if least is None else least, max(high, own) if most is None else most


def checked_ranges(label: str, randomisation: Any) -> dict[str, tuple[float, float]]:
    """Check the ranges of the quantities that are drawn for each episode.

    Raises:
        TypeError, ValueError: for an unknown quantity or a bad range.
    """
    ranges = {}
    for name, limits in mapping(label, randomisation).items():
        if name not in QUANTITIES:
            raise ValueError(f"{label}[{shown(name)}]: no such quantity; there are {', '.join(map(repr, QUANTITIES))}")
        one = QUANTITIES[name]
        low, high = pair(f"{label}[{shown(name)}]", limits, DRAWN[name], least=one.least, most=one.most)
        if low > high:
            raise ValueError(f"{label}[{shown(name)}] = {shown(limits)}: the first must not be above the second")
        ranges[name] = (low, high)
    return ranges
