"""The map between an action in [-1, 1] and what it stands for: a torque, a shift, a gain.

Symbols: ``lambda`` the gain that multiplies the control law's torque (14), dimensionless. The baselines
write actions with it; the kernels read them by the same formula (`actuation`), as tests hold them to.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.validation import choice

ACTION_MODES = ("torque", "residual", "reference", "gain")


def physical_from_action(mode: str, action: ArrayLike, limit: ArrayLike) -> NDArray[np.float64]:
    """Convert an action in [-1, 1] to the physical value that it stands for, in the action mode's unit.

    Args:
        mode: "torque" and "residual": torques [N m]; "reference": shifts of the joints' reference [rad]; "gain":
            lambda, dimensionless.
        action: values in [-1, 1]. Shape (..., channels).
        limit: value of the action 1; one for all channels or one each, as `Settings.action_limit`.

    Returns:
        ``limit action``; for the gain `gain_from_action`. Shape of ``action``.

    Raises:
        ValueError: for another mode, an action that is not finite or not in [-1, 1], or a limit that is not positive.
    """
    if choice("mode", mode, ACTION_MODES) == "gain":
        return gain_from_action(action, limit)
    return np.asarray(_checked_range("action", action, -1.0, 1.0) * _checked_limit(limit))


def action_from_physical(mode: str, value: ArrayLike, limit: ArrayLike) -> NDArray[np.float64]:
    """Convert a physical value to the action in [-1, 1] that stands for it; the inverse of `physical_from_action`.

    Args:
        mode: see there.
        value: in the mode's unit, within the limit. Shape (..., channels).
        limit: see there.

    Returns:
        ``value / limit``; for the gain `action_from_gain`. Shape of ``value``.

    Raises:
        ValueError: for another mode, a value that is not finite or beyond the limit, or a limit that is not positive.
    """
    if choice("mode", mode, ACTION_MODES) == "gain":
        return action_from_gain(value, limit)
    return _checked_range("value / limit", np.asarray(value, dtype=np.float64) / _checked_limit(limit), -1.0, 1.0)


def gain_from_action(action: ArrayLike, gain_limit: ArrayLike) -> NDArray[np.float64]:
    """Return the gain that an action stands for: ``gain_limit (action + 1) / 2``.

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
    return np.asarray(limit * (0.5 * (values + 1.0)))  # in this order: 1 gives the limit itself, never more


def action_from_gain(gain: ArrayLike, gain_limit: ArrayLike) -> NDArray[np.float64]:
    """Return the action that stands for a gain: ``2 gain / gain_limit - 1``.

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
