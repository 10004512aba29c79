"""Hyperstability: where torque -> rate stops being positive real."""

from collections.abc import Callable
from typing import Any

import numpy as np

from flexarm_env import ArmParameters, FlexibleArm, LawParameters, SensorParameters
from flexarm_env.analysis import (
    OperatingPoint,
    Plant,
    force_to_rate,
    joint_angles,
    linear_plant,
    natural_modes,
    passivity,
    rigid_point,
    true_point,
)

SEED = 2008
NOTICEABLE = 0.01  # share of the norm
WAVE_SPEED = SensorParameters().wave_speed


def paths() -> dict[str, Callable[[OperatingPoint], Plant]]:
    """Return the transfer paths that are checked, by name."""

    def late(position: float) -> float:
        return (4.5 + position) / WAVE_SPEED

    return {
        "joint torques -> joint rates": lambda p: linear_plant(p, joint_angles(rate=True)),
        "law's force -> rigid point's rate, tip": lambda p: force_to_rate(p, rigid_point(4.5)),
        "the same, 31.2 ms late": lambda p: force_to_rate(p, rigid_point(4.5, delay=late(4.5))),
        "law's force -> rigid point's rate, 0.5 m": lambda p: force_to_rate(p, rigid_point(0.5)),
        "the same, 17.3 ms late": lambda p: force_to_rate(p, rigid_point(0.5, delay=late(0.5))),
        "law's force -> true point's rate, 0.5 m": lambda p: force_to_rate(p, true_point(0.5)),
        "law's force -> true point's rate, 2.25 m": lambda p: force_to_rate(p, true_point(2.25)),
        "law's force -> true point's rate, tip": lambda p: force_to_rate(p, true_point(4.5)),
    }


def random_poses(arm: FlexibleArm, count: int) -> list[OperatingPoint]:
    """Draw angles of resting arms uniformly, without those within 0.2 rad of straight or folded."""
    rng = np.random.default_rng(SEED)
    poses: list[OperatingPoint] = []
    while len(poses) < count:
        angles = rng.uniform(-np.pi, np.pi, 2)
        if abs(np.sin(angles[1])) > np.sin(0.2):
            poses.append(OperatingPoint.at_angles(arm, angles))
    return poses


def study(frequencies: int = 400, count: int = 60) -> dict[str, Any]:
    """Find the smallest relative eigenvalue of the Hermitian part over frequency and poses, for each path."""
    arm = FlexibleArm(ArmParameters.linear())
    omega = np.geomspace(0.1, 1000.0, frequencies)
    poses = random_poses(arm, count)
    curves: dict[str, list[float]] = {}
    rows = []
    for name, path in paths().items():
        checks = [passivity(path(pose), omega) for pose in poses]
        least = np.min([check.relative for check in checks], axis=0)
        negative = omega[least < -NOTICEABLE]
        curves[name] = least.tolist()
        rows.append(
            {
                "path": name,
                "worst": float(least.min()),
                "at": float(omega[np.argmin(least)]),
                "negative_from": float(negative[0]) if len(negative) else None,
            }
        )
    return {"omega": omega.tolist(), "curves": curves, "rows": rows, "poses": len(poses), "law": law()}


def law() -> dict[str, Any]:
    """Return the law's damping over frequency, for one shared delay, and the frequencies that it meets.

    Against a rate v the law's force is ``Z v`` with ``Re Z = Kd - Kp sin(omega T) / omega`` (late position) or
    ``Kd cos(omega T) - Kp sin(omega T) / omega`` (late position and rate).
    """
    gains, delay = LawParameters(), 9.0 / WAVE_SPEED
    omega = np.linspace(0.5, 250.0, 1000)
    spring = gains.proportional_gain * np.sin(omega * delay) / omega
    bent = OperatingPoint.at_angles(FlexibleArm(ArmParameters.linear()), (0.0, 1.5))
    modes = {joints: natural_modes(bent, joints).frequencies.tolist() for joints in ("free", "locked")}
    turns = gains.derivative_gain * np.cos(omega * delay) - spring
    return {
        "omega": omega.tolist(),
        "position": (gains.derivative_gain - spring).tolist(),
        "position+rate": turns.tolist(),
        "delay": delay,
        "longest_passive_delay": gains.derivative_gain / gains.proportional_gain,
        "active_from": float(omega[np.argmax(turns < 0.0)]),
        "modes": modes,
    }
