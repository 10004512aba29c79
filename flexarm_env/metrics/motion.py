"""Vibration, acceleration, and the side of the elbow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_env.metrics.window import instants
from flexarm_env.physics.inverse_kinematics import elbow_side
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.trajectory import Trajectory

Array = NDArray[np.float64]


def vibration(run: Trajectory, since: float = 0.0, until: float = np.inf) -> float:
    """Return the r.m.s. rate of the links' tip deflections, both links together [m/s].

    Args:
        run: any run.
        since: from this time on [s].
        until: up to this time [s].
    """
    arm = FlexibleArm(run.parameters)
    rates = arm.tip_deflection(run.state[:, arm.size :])[instants(run.time, since, until)]  # linear in the coordinates
    return float(np.sqrt(np.mean(np.sum(rates**2, axis=1))))


def tip_acceleration(run: Trajectory, since: float = 0.0, until: float = np.inf) -> float:
    """Return the r.m.s. acceleration of the rigid-kinematics tip, by second differences [m/s^2].

    Args:
        run: a run of at least 3 instants, evenly spaced.
        since: from this time on [s].
        until: up to this time [s].
    """
    if len(run) < 3:
        raise ValueError(f"run: must have at least 3 instants, got {len(run)}")
    step = run.time[1] - run.time[0]
    acceleration = np.diff(run.rigid_tip, n=2, axis=0) / step**2
    inside = instants(run.time[1:-1], since, until)
    return float(np.sqrt(np.mean(np.sum(acceleration[inside] ** 2, axis=1))))


def elbow_changes(run: Trajectory) -> Array:
    """Return when the elbow changed sides: the times at which the sign of sin(theta2) changed.

    The elbow is on a side only where it is bent by more than `STRAIGHT`, 0.05 rad, off the straight and off the folded
    arm (`elbow_side`; the environments' infos count by the same rule). A motion within that band, and one that comes
    back to the side that it left, is no change. The time of a change is the last at which theta2 passed 0 (or pi) on
    the way to the new side.

    Args:
        run: any run, sampled finely enough that theta2 moves by less than pi between two instants.

    Returns:
        Times [s], interpolated linearly between instants. Shape (changes,).
    """
    return times_of_changes(run.time, run.state[:, 1])


def times_of_changes(time: Array, elbow: Array) -> Array:
    """Return when the elbow changed sides, from its angle; see `elbow_changes`.

    Args:
        time: [s]. Shape (n,).
        elbow: theta2 [rad]. Shape (n,).
    """
    bend, sides = np.sin(elbow), elbow_side(elbow)
    (bent,) = np.nonzero(sides)
    sides = sides[bent]
    (turns,) = np.nonzero(sides[1:] != sides[:-1])
    times = []
    for before, after in zip(bent[turns], bent[turns + 1], strict=True):
        (not_yet,) = np.nonzero(bend[before:after] * bend[after] <= 0.0)
        last = before + not_yet[-1]
        share = bend[last] / (bend[last] - bend[last + 1])
        times.append(time[last] + share * (time[last + 1] - time[last]))
    return np.array(times, dtype=float)
