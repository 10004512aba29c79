"""Bounds of observations: how far references, readings and joints get before an episode ends.

Scales, by which observations may be divided, are given with the bounds of a block (`Range`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from flexarm_env.envs.choices import REACH, move_ring
from flexarm_env.envs.corners import worst
from flexarm_env.envs.own_paths import largest_speed
from flexarm_env.envs.sensors import LINK_2, Sensor, mounting
from flexarm_env.envs.settings import Settings
from flexarm_env.parameters import SENSOR_MODELS
from flexarm_env.physics.inverse_kinematics import LEAST_SINE
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.limits import ANGLE_LIMITS, RATE_LIMIT, state_limits

MOST_SECONDS = 1e9  # of an episode
LARGEST_DEVIATE = 8.6  # of `elementary.normal`


class Workspace(NamedTuple):
    """Largest magnitudes of the reference.

    Attributes:
        radius: distance of the reference from the shoulder [m].
        speed: speed of the reference [m/s].
    """

    radius: float
    speed: float


class Range(NamedTuple):
    """Scales and bounds of a block's numbers, one for each number.

    Attributes:
        scale: divisors of the numbers where observations are scaled.
        bound: largest magnitudes of the numbers before the episode ends.
    """

    scale: list[float]
    bound: list[float]


def reach_of(settings: Settings) -> Workspace:
    """Compute the largest magnitudes of the reference."""
    if settings.paths:
        tables = [path.table for path in settings.paths]
        radius = max(float(np.linalg.norm(table[:, 1:], axis=1).max()) for table in tables)
        moves = [np.diff(table, axis=0) for table in tables]
        speed = max(float((np.linalg.norm(move[:, 1:], axis=1) / move[:, 0]).max()) for move in moves)
        speed *= settings.reference_speed if settings.mode.races else 1.0  # tables by distance have directions
    else:
        arm = settings.flexible_arm.parameters
        radius = move_ring(arm)[1] if settings.reference == ("moves",) else arm.reach
        speed = largest_speed(settings)
    return Workspace(radius, speed)


def position_bounds(settings: Settings, sensor: Sensor, reach: Workspace) -> tuple[float, float]:
    """Return the largest lengths of a position that a sensor reads, and of its error, before an episode ends [m]."""
    length_1 = settings.flexible_arm.parameters.link_lengths[0]
    if sensor is LINK_2:
        rigid, bends = length_1 + settings.sensor_position, SENSOR_MODELS[settings.sensor].bends
        compared, deviation = reach.radius, settings.range_of("noise")[1]
    else:
        one = mounting(settings, sensor)
        compared = rigid = one.position + (length_1 if one.link == 2 else 0.0)
        bends, deviation = True, one.noise[0]
    sensed = rigid + (_bend(settings.flexible_arm) if bends else 0.0) + LARGEST_DEVIATE * deviation
    return sensed * 2**0.5, (sensed + compared) * 2**0.5


def _bend(arm: FlexibleArm) -> float:
    """Bound the tip's displacement by valid deflections [m]: a link's length for each mode, and foreshortening."""
    m = arm.parameters.modes_per_link
    across = m * sum(arm.parameters.link_lengths)
    if not arm.constants.foreshortened:
        return across
    largest = state_limits(arm)[2 : arm.size].reshape(2, m)
    sums = [np.abs(link.foreshortening(link.length)) for link in arm.modes]
    return across + float(sum(0.5 * q @ s @ q for q, s in zip(largest, sums, strict=True)))


def check_moving_start(settings: Settings, start: str) -> None:
    """Refuse a start on the move if the reference needs joint rates that end an episode at once.

    Raises:
        ValueError: naming start and lap time.
    """
    if start not in ("moving", "mix"):
        return
    asked = _reference_joint_rate(settings, reach_of(worst(settings, lambda one: reach_of(one).speed)))
    if asked > RATE_LIMIT:
        raise ValueError(
            f"start = {start!r} with lap_time = {settings.laps[0]} s: the reference may ask for {asked:.4g} rad/s "
            f"of a joint, and {RATE_LIMIT:g} end an episode; give a longer lap_time, or start at rest"
        )


def even_range(count: int, scale: float, bound: float) -> Range:
    """Return the same scale and bound for each of `count` numbers."""
    return Range([scale] * count, [bound] * count)


def modal_range(settings: Settings, rates: bool) -> Range:
    """Return scales and bounds of modal coordinates or rates.

    The scale of a first mode corresponds to a tip deflection of 0.5 m or 2 m/s at `REACH`, that of a higher mode to a
    tenth of the deflection and half of the rate.
    """
    arm = settings.flexible_arm
    tips = np.concatenate([np.abs(link.tip_values) for link in arm.modes])
    order = np.tile(np.arange(arm.parameters.modes_per_link), 2)
    scale = np.where(order == 0, 2.0, 1.0) if rates else np.where(order == 0, 0.5, 0.05)
    bound = state_limits(arm)
    part = bound[arm.size + 2 :] if rates else bound[2 : arm.size]
    return Range((arm.parameters.reach / REACH * scale / tips).tolist(), part.tolist())


def gauged_range(settings: Settings, rates: bool) -> Range:
    """Return scales and bounds of modal coordinates or rates as strain gauges read them."""
    found, modes = modal_range(settings, rates), settings.flexible_arm.parameters.modes_per_link
    for link, drift in enumerate(settings.gauge_drift):
        found.bound[link * modes] += abs(drift) * (1.0 if rates else MOST_SECONDS)
    return found


def measured_angle_bounds(settings: Settings) -> list[float]:
    """Return the largest angles of the joints that encoders read [rad]; a count rounds by half of it."""
    noise, counts = settings.encoder_noise[0], settings.encoder_resolution
    return [limit + LARGEST_DEVIATE * noise + 0.5 * count for limit, count in zip(ANGLE_LIMITS, counts, strict=True)]


def measured_rate_bound(settings: Settings) -> float:
    """Return the largest rate of a joint that an encoder reads [rad/s]; a count's rounding may add one count."""
    counts = max(settings.encoder_resolution) / settings.control_period
    return RATE_LIMIT + LARGEST_DEVIATE * settings.encoder_noise[1] + counts


def joint_rate_bound(settings: Settings, reach: Workspace) -> float:
    """Return the largest difference between a joint's rate on the reference and its measured rate [rad/s]."""
    return measured_rate_bound(settings) + _reference_joint_rate(settings, reach)


def _reference_joint_rate(settings: Settings, reach: Workspace) -> float:
    """Return the largest joint rate of the rigid arm on the reference [rad/s]."""
    length_1, length_2 = settings.flexible_arm.parameters.link_lengths
    return reach.speed * (length_1 + length_2) / (length_1 * length_2 * LEAST_SINE)
