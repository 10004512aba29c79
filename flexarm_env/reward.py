"""Reward: terms of the state after the step. Compiled into the kernels as it stands (`kernels`)."""

from __future__ import annotations

from math import exp, sqrt

TERMS = ("tracking_wide", "tracking_narrow")
# Widths [m] of the two bounded tracking terms: a wide one that pulls from afar, a narrow one that rewards precision.
# Each term is in [0, 0.5], so that ending an episode early never pays.
WIDTHS = (0.6, 0.15)


def reward_terms(x: float, y: float, reference_x: float, reference_y: float) -> tuple[float, float]:
    """Weighted terms of the reward, in the order of `TERMS`; their sum is the reward.

    Args:
        x: of the true tip [m].
        y: of the true tip [m].
        reference_x: where it should be [m].
        reference_y: where it should be [m].

    Returns:
        ``0.5 exp(-(e / WIDTHS[0])^2)`` and ``0.5 exp(-e / WIDTHS[1])``, e the distance of the two.
    """
    square = (x - reference_x) * (x - reference_x) + (y - reference_y) * (y - reference_y)
    return 0.5 * exp(-square / (WIDTHS[0] * WIDTHS[0])), 0.5 * exp(-sqrt(square) / WIDTHS[1])
