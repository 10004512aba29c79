"""The map between an action in [-1, 1] and a gain in [0, gain_limit].

Symbols: ``lambda`` the gain that multiplies the control law's torque (14), dimensionless. The environment
reads actions with it and the baselines write them with it, so that both mean the same gain.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray


def gain_from_action(action: ArrayLike, gain_limit: ArrayLike) -> NDArray[np.float64]:
    """Gain that an action stands for: ``gain_limit (action + 1) / 2``.

    Args:
        action: values in [-1, 1], any shape.
        gain_limit: largest gain, positive, dimensionless; one for all, or one each.

    Returns:
        Gains in [0, gain_limit], dimensionless, shape of ``action``.

    Raises:
        ValueError: an action is not finite or not in [-1, 1], or the limit is not finite and positive.
    """
    limit = _checked_limit(gain_limit)
    values = _checked_range("action", action, -1.0, 1.0)
    return np.asarray(scaled(values, limit))


def scaled(action: Any, gain_limit: Any) -> Any:
    """The formula of `gain_from_action`, without checks, for values that are known to be valid."""
    return gain_limit * (0.5 * (action + 1.0))  # in this order: 1 gives the limit itself, never more


def action_from_gain(gain: ArrayLike, gain_limit: ArrayLike) -> NDArray[np.float64]:
    """Action that stands for a gain: ``2 gain / gain_limit - 1``.

    Args:
        gain: values in [0, gain_limit], dimensionless, any shape.
        gain_limit: largest gain, positive, dimensionless; one for all, or one each.

    Returns:
        Actions in [-1, 1], shape of ``gain``.

    Raises:
        ValueError: a gain is not finite or not in [0, gain_limit], or the limit is not finite and positive.
    """
    limit = _checked_limit(gain_limit)
    values = _checked_range("gain", gain, 0.0, limit)
    return np.asarray(2.0 * (values / limit) - 1.0)  # in this order: the limit gives 1 itself, never more


def _checked_limit(gain_limit: ArrayLike) -> NDArray[np.float64] | float:
    if isinstance(gain_limit, float) and 0.0 < gain_limit < np.inf:
        return gain_limit
    limits = np.asarray(gain_limit, dtype=np.float64)
    valid = (limits > 0.0) & (limits < np.inf)
    if not valid.all():
        raise ValueError(f"gain_limit = {float(limits[~valid].flat[0])!r}: must be a finite number > 0")
    return limits


def _checked_range(name: str, value: ArrayLike, low: float, high: NDArray[np.float64] | float) -> NDArray[np.float64]:
    values = np.asarray(value, dtype=np.float64)
    inside = (values >= low) & (values <= high)  # false for nan
    if not inside.all():
        index = int(np.argmin(inside))
        worst, bound = (np.broadcast_to(each, inside.shape).flat[index] for each in (values, high))
        raise ValueError(f"{name} = {float(worst)!r}: must be finite and in [{low}, {float(bound)}]")
    return values
