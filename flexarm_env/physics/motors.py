"""Motors that are not ideal: a current loop of first order, and the torque that is left at speed.

The torque m of the current loop follows the commanded one u as ``T m' = u - m``. Of it acts what the supply's voltage
allows: the magnitude falls linearly from the stall torque at rest to 0 at the no-load speed in the direction of
motion; against the motion the stall torque is there, which the current limits (the steady line of a DC motor behind a
current limit: Siciliano, Sciavicco, Villani & Oriolo, *Robotics*, 2009, section 5.2). Inductance is in T alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np

from flexarm_env.codegen.tracing import clip

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(16)
_NODES, _WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS


@lru_cache(maxsize=256)
def response(lag: float) -> tuple[float, float, float, float]:
    """Return which share of its distance from a held command the current loop's torque still has within a step.

    At the start, middle and end of the step the share is that of the parabola with the moments 0, 1 and 2 of
    ``exp(-t / T)``. The Runge-Kutta method, which only sees these instants, then transfers the exact momentum whatever
    T is.

    Args:
        lag: step over T; inf for an ideal motor.

    Returns:
        The parabola at the step's start, middle and end, then the exact share at the end, exp(-lag).
    """
    end = float(np.exp(-lag))
    if lag > 1.0:
        moments = [(1.0 - end) / lag]
        for n in (1, 2):
            moments.append((n * moments[-1] - end) / lag)
    else:  # the differences above would cancel
        moments = [float(_WEIGHTS @ (_NODES**n * np.exp(-lag * _NODES))) for n in range(3)]
    mean, tilt, bend = moments[0], 2.0 * moments[1] - moments[0], 6.0 * (moments[2] - moments[1]) + moments[0]
    return mean - 3.0 * tilt + 5.0 * bend, mean - 2.5 * bend, mean + 3.0 * tilt + 5.0 * bend, end


def available(torque: Sequence[Any], rates: Sequence[Any], stall: Sequence[Any], per_speed: Sequence[Any]) -> list[Any]:
    """Return what acts of the current loops' torques [N m].

    Args:
        torque: of shoulder and elbow [N m].
        rates: of theta1 and theta2 [rad/s].
        stall: torque at rest [N m]; inf where there is no limit.
        per_speed: one over the no-load speed [s/rad]; 0 where there is no limit.
    """
    acting = []
    for wanted, rate, most, slope in zip(torque, rates, stall, per_speed, strict=True):
        share = rate * slope
        acting.append(clip(wanted, -most * clip(1.0 + share, 0.0, 1.0), most * clip(1.0 - share, 0.0, 1.0)))
    return acting
