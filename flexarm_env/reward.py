"""Reward: named terms of the state after the step, and their weighted sum."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Two bounded tracking terms, a wide one that pulls from afar and a narrow one that rewards precision. All are in
# [0, 1], so that ending an episode early never pays.
WIDE = 0.6  # [m]
NARROW = 0.15  # [m]


def reward_terms(tip: ArrayLike, reference: ArrayLike) -> dict[str, NDArray[np.float64]]:
    """Weighted terms of the reward, each in [0, 0.5].

    Args:
        tip: true tip [m]. Shape (..., 2).
        reference: where it should be [m]. Shape (..., 2).

    Returns:
        "tracking_wide": ``0.5 exp(-(e / 0.6 m)^2)``; "tracking_narrow": ``0.5 exp(-e / 0.15 m)``, e the distance
        of the two. Shape (...) each.
    """
    x, y = np.moveaxis(np.asarray(tip, dtype=float) - np.asarray(reference, dtype=float), -1, 0)
    distance = np.sqrt(x * x + y * y)
    return {
        "tracking_wide": 0.5 * np.exp(-((distance / WIDE) ** 2)),
        "tracking_narrow": 0.5 * np.exp(-distance / NARROW),
    }
