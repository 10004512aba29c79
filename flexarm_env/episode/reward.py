"""Reward: terms of the state after the step, each in [0, 1], and their weighted sum.

No term is negative: with weights of 0 or more, ending an episode early never pays. The functions take plain numbers;
kernels are recorded from them.

Symbols: ``e`` distance of the true tip (with deflection) from the reference [m]; ``a`` action in [-1, 1].
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from flexarm_env.codegen.elementary import exp_minus
from flexarm_env.codegen.tracing import root

TERMS = {
    "tracking_wide": "exp(-(e / 0.6 m)^2): pulls from afar",
    "tracking_middle": "exp(-e / 0.15 m): rewards precision",
    "tracking_fine": "exp(-e / 0.04 m): rewards the last centimetres",
    "action_change": "1 / (1 + |a - a_before|^2 / 0.5): one for a steady action",
    "effort": "1 / (1 + (tau_1 / 150 N m)^2 + (tau_2 / 50 N m)^2)",
    "vibration": "1 / (1 + (|w_1'|^2 + |w_2'|^2) / (1 m/s)^2), w' the rates of the links' tip deflections",
    "progress": "speed of the reference over `reference_speed`; only of a race, which has no clock",
}
OF_RACES = ("progress",)  # the last terms, which other programs do not have
WIDTHS = (0.6, 0.15, 0.04)  # [m]
CHANGE = 0.5
EFFORT = (150.0, 50.0)  # [N m]
VIBRATION = 1.0  # [m/s]


def squared_distance(tip: Sequence[Any], reference: Sequence[Any]) -> Any:
    """Return the squared distance of the true tip from the reference [m^2].

    Args:
        tip: x, y of the true tip [m].
        reference: x, y of the reference [m].
    """
    x, y = tip[0] - reference[0], tip[1] - reference[1]
    return x * x + y * y


def progress_term(speed: Any, largest: Any) -> Any:
    """Compute the term for progress along the path: the reference's speed over its largest speed, both in m/s."""
    return speed / largest


def tracking_terms(square: Any) -> list[Any]:
    """Compute the three tracking terms.

    Args:
        square: squared distance of the true tip from the reference [m^2].
    """
    distance = root(square)
    wide, middle, fine = WIDTHS
    return [exp_minus(square / (wide * wide)), exp_minus(distance / middle), exp_minus(distance / fine)]


def regularising_terms(change: Any, torque: Sequence[Any], deflection_rate: Sequence[Any]) -> list[Any]:
    """Compute the terms for steady actions, small torques and little vibration.

    Args:
        change: |a - a_before|^2.
        torque: torque of shoulder and elbow [N m].
        deflection_rate: deflection rate of the two links' tips [m/s].
    """
    effort = [torque[j] / EFFORT[j] for j in (0, 1)]
    rates = [rate / VIBRATION for rate in deflection_rate]
    return [
        1.0 / (1.0 + change / CHANGE),
        1.0 / (1.0 + effort[0] * effort[0] + effort[1] * effort[1]),
        1.0 / (1.0 + rates[0] * rates[0] + rates[1] * rates[1]),
    ]
