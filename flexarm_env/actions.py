"""What an action in [-1, 1] stands for: the action modes, each declared once, and the map to physical values.

All that depends on the mode reads `MODES`: options and their defaults, kernels, integration step, documentation. The
kernels apply the map themselves (`episode.actuation`); a test compares both.

Symbols: ``lambda`` the gain that multiplies the control law's torque (14), dimensionless.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.validation import choice

TORQUE_LIMIT = (150.0, 50.0)  # [N m], of shoulder and elbow
JOINTS = ("shoulder", "elbow")
# What changes the arm or acts on it within an episode; the implicit integrator of the gain knows none of it.
ON_THE_ARM = ("payload_changes", "pulse_force", "pulse_time", "pulse_duration", "pulse_period")
# Options that make motors not ideal, with the values at which they are.
IDEAL_MOTORS = {"motor_time_constant": (0.0, 0.0), "torque_speed_limit": None, "torque_resolution": (0.0, 0.0)}


@dataclass(frozen=True, kw_only=True)
class ActionMode:
    """What an entry a of an action, in [-1, 1], stands for, and what the mode asks of the environment.

    Attributes:
        text: description.
        quantity: name of the physical quantity in the formulas.
        unit: its unit.
        formula: the quantity from a, as Python writes it; other names are options.
        inverse: a from the quantity.
        limit: the option that sets the quantity at a = 1; `Settings.action_limit` has its value.
        channels: what each entry belongs to.
        least: the quantity at a = -1, as a share of that at 1: -1 or 0.
        mirror: sign of each entry in the mirrored episode, repeated over them (`FlexArmEnvBase.mirror_action`).
        idle: the action that commands nothing; the actions before an episode's first one.
        program: name of the kernels' program (`episode.step.PROGRAMS`).
        integrator: "explicit" (Runge-Kutta) or "implicit" (ARS(4,4,3)); it sets the stability bound
            (`simulation.stability.STABLE_ANGLE`) and the default integration step.
        law: the feedback law that acts beside or under the action: "joints" (joint-space tracking), "tip" (the
            paper's), or "" for none.
        torque_limit: default of that option [N m]; None: no limit.
        accumulates: the command is the sum of the actions, and the kernels keep it beside them.
        shifts: the action shifts the aim of the joint-space law; its delay is then a whole number of periods.
        races: the last entry is the speed of the reference along the path (`episode.race`), whose formulas are `PACE`.
        options: options that only some modes read, and this one does.
    """

    text: str
    quantity: str
    unit: str
    formula: str
    inverse: str
    limit: str
    channels: tuple[str, ...] = JOINTS
    least: float = -1.0
    mirror: tuple[int, ...] = (-1,)
    idle: float = 0.0
    program: str
    integrator: Literal["explicit", "implicit"] = "explicit"
    law: Literal["", "joints", "tip"] = ""
    torque_limit: tuple[float, float] | None = TORQUE_LIMIT
    accumulates: bool = False
    shifts: bool = False
    races: bool = False
    options: tuple[str, ...] = ()


PACE = ("speed", "reference_speed * a", "speed / reference_speed", "m/s")  # quantity, formula, inverse, unit
MODES: dict[str, ActionMode] = {
    "torque": ActionMode(
        text="torque of the motors, held over the control period",
        quantity="torque",
        unit="N m",
        formula="torque_limit * a",
        inverse="torque / torque_limit",
        limit="torque_limit",
        program="torque",
        options=(*ON_THE_ARM, *IDEAL_MOTORS),
    ),
    "torque_rate": ActionMode(
        text="change of the motors' torque per second: at the start of a control period the torque becomes "
        "`clip(torque + torque_rate * control_period, -torque_limit, torque_limit)`, from 0 at the reset, and is held; "
        "the block `torque` observes it. Its spectrum is bounded, so that it excites high modes little",
        quantity="torque_rate",
        unit="N m/s",
        formula="torque_rate_limit * a",
        inverse="torque_rate / torque_rate_limit",
        limit="torque_rate_limit",
        program="torque_rate",
        accumulates=True,
        options=("torque_rate_limit", *ON_THE_ARM, *IDEAL_MOTORS),
    ),
    "residual": ActionMode(
        text="torque added to an inner joint-space tracking law (a spring and a damper between each joint and the "
        "rigid arm's way along the path), which acts in continuous time; `torque_limit` limits the sum too",
        quantity="residual",
        unit="N m",
        formula="torque_limit * a",
        inverse="residual / torque_limit",
        limit="torque_limit",
        program="tracking",
        law="joints",
        options=("inner_stiffness", "inner_damping", *ON_THE_ARM),
    ),
    "reference": ActionMode(
        text="shift of that law's joint target, reached linearly within the control period",
        quantity="shift",
        unit="rad",
        formula="shift_limit * a",
        inverse="shift / shift_limit",
        limit="shift_limit",
        program="tracking",
        law="joints",
        shifts=True,
        options=("shift_limit", "inner_stiffness", "inner_damping", *ON_THE_ARM),
    ),
    "gain": ActionMode(
        text="the gain lambda of the paper's law (10), (14), which acts in continuous time",
        quantity="gain",
        unit="1",
        formula="gain_limit * (a + 1) / 2",
        inverse="2 * gain / gain_limit - 1",
        limit="gain_limit",
        channels=("law",),
        least=0.0,
        mirror=(1,),
        idle=-1.0,
        program="gain",
        integrator="implicit",
        law="tip",
        torque_limit=None,
        options=(
            *("gain_limit", "proportional_gain", "derivative_gain", "compensation"),
            *("feedback_source", "rate_jacobian", "delayed"),
        ),
    ),
    "race": ActionMode(
        text="torque of the motors, held over the control period; and the speed at which the reference moves along the "
        "path. It approaches the commanded speed by `reference_acceleration * control_period` at most in a control "
        "period, over which it is constant; below 0 stands for standstill. There is no clock: the episode ends when "
        "`race_laps` laps are done",
        quantity="torque",
        unit="N m",
        formula="torque_limit * a",
        inverse="torque / torque_limit",
        limit="torque_limit",
        channels=(*JOINTS, "reference"),
        mirror=(-1, -1, 1),
        program="race",
        races=True,
        options=("race_laps", "reference_speed", "reference_acceleration", *ON_THE_ARM[1:], *IDEAL_MOTORS),
    ),
}


def modes_reading(option: str) -> tuple[str, ...]:
    """Return the names of the action modes that read an option: all, unless `ActionMode.options` of some name it."""
    readers = tuple(name for name, mode in MODES.items() if option in mode.options)
    return readers or tuple(MODES)


def physical_from_action(mode: str, action: ArrayLike, limit: ArrayLike) -> NDArray[np.float64]:
    """Convert an action in [-1, 1] to the physical value that it stands for, in the action mode's unit.

    Args:
        mode: a name in `MODES`, which has the unit.
        action: values in [-1, 1]. Shape (..., channels).
        limit: value of the action 1; one for all channels or one each, as `Settings.action_limit`.

    Returns:
        ``limit action``, or where the action -1 stands for 0, `gain_from_action`. Shape of ``action``. A race's third
        number below 0 is returned as it is, and stands for standstill.

    Raises:
        ValueError: for another mode, an action beyond [-1, 1], or a limit that is not above 0.
    """
    if MODES[choice("mode", mode, MODES)].least == 0.0:
        return gain_from_action(action, limit)
    return np.asarray(_checked_range("action", action, -1.0, 1.0) * _checked_limit("limit", limit))


def action_from_physical(mode: str, value: ArrayLike, limit: ArrayLike) -> NDArray[np.float64]:
    """Convert a physical value to the action in [-1, 1] that stands for it: invert `physical_from_action`, see there.

    Returns:
        ``value / limit``, or where the action -1 stands for 0, `action_from_gain`. Shape of ``value``.

    Raises:
        ValueError: for another mode, a value beyond the limit, or a limit that is not above 0.
    """
    if MODES[choice("mode", mode, MODES)].least == 0.0:
        return action_from_gain(value, limit)
    return _checked_range(
        "value / limit", np.asarray(value, dtype=np.float64) / _checked_limit("limit", limit), -1.0, 1.0
    )


def gain_from_action(action: ArrayLike, gain_limit: ArrayLike) -> NDArray[np.float64]:
    """Return the gain that an action stands for: ``gain_limit (action + 1) / 2``.

    Args:
        action: values in [-1, 1], any shape.
        gain_limit: largest gain, positive, dimensionless; one for all, or one each.

    Returns:
        Gains in [0, gain_limit], dimensionless, shape of ``action``.
    """
    limit = _checked_limit("gain_limit", gain_limit)
    values = _checked_range("action", action, -1.0, 1.0)
    return np.asarray(limit * (0.5 * (values + 1.0)))  # in this order: 1 gives the limit itself, never more


def action_from_gain(gain: ArrayLike, gain_limit: ArrayLike) -> NDArray[np.float64]:
    """Return the action that stands for a gain: ``2 gain / gain_limit - 1``.

    Args:
        gain: values in [0, gain_limit], dimensionless, any shape.
        gain_limit: largest gain, positive, dimensionless; one for all, or one each.

    Returns:
        Actions in [-1, 1], shape of ``gain``.
    """
    limit = _checked_limit("gain_limit", gain_limit)
    values = _checked_range("gain", gain, 0.0, limit)
    return np.asarray(2.0 * (values / limit) - 1.0)  # in this order: the limit gives 1 itself, never more


def _checked_limit(name: str, limit: ArrayLike) -> NDArray[np.float64] | float:
    if isinstance(limit, float) and 0.0 < limit < np.inf:
        return limit
    limits = np.asarray(limit, dtype=np.float64)
    valid = (limits > 0.0) & (limits < np.inf)
    if not valid.all():
        raise ValueError(f"{name} = {float(limits[~valid].flat[0])!r}: must be a finite number > 0")
    return limits


def _checked_range(name: str, value: ArrayLike, low: float, high: NDArray[np.float64] | float) -> NDArray[np.float64]:
    values = np.asarray(value, dtype=np.float64)
    inside = (values >= low) & (values <= high)  # false for nan
    if not inside.all():
        index = int(np.argmin(inside))
        worst, bound = (np.broadcast_to(each, inside.shape).flat[index] for each in (values, high))
        raise ValueError(f"{name} = {float(worst)!r}: must be finite and in [{low}, {float(bound)}]")
    return values
