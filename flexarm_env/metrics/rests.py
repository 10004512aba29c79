"""How a tip comes to rest after each move of a reference that stops, and how much the links are stressed."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.metrics.window import rms
from flexarm_env.simulation.arm import FlexibleArm

Array = NDArray[np.float64]

ARRIVED = 0.02  # [m]; the tip has settled once its distance from the reference stays at or below this
STILL = 1e-9  # [m]; a reference that moves less from one instant to the next rests
SHORTEST = 0.1  # [s], of a rest: a reference may be slow for an instant where it turns
PLACES = 33  # along a link, root and tip included, where its bending moment is computed


class Rest(NamedTuple):
    """What a tip did while the reference rested.

    Attributes:
        begin: when the reference arrived [s].
        end: when it left, or the record ended [s].
        settling_time: from the arrival until the tip's distance from the reference stays within the band [s]; inf if it
            does not before the reference leaves.
        vibration: r.m.s. distance of the tip from its mean place over the whole rest [m].
        swing: peak to peak of the deflection of the links' tips over the whole rest [m].
    """

    begin: float
    end: float
    settling_time: float
    vibration: float
    swing: tuple[float, float]


def rests(
    time: Array, tip: Array, reference: Array, deflection: Array | None = None, band: float = ARRIVED
) -> list[Rest]:
    """Return what a tip did in each rest of a reference that follows a move.

    Args:
        time: [s]. Shape (n,).
        tip: true tip [m]. Shape (n, 2).
        reference: [m]. Shape (n, 2).
        deflection: of the links' tips [m]; None: the swing is nan. Shape (n, 2).
        band: see `ARRIVED` [m].
    """
    still = np.linalg.norm(np.diff(reference, axis=0), axis=1) <= STILL
    # instants at which it begins to move or to rest; before the first one it rests, after the last one it moves
    changes = np.flatnonzero(np.diff(np.concatenate([[True], still, [False]]).astype(int)))
    found = []
    for first, last in zip(changes[1::2], changes[2::2], strict=False):  # it arrives, and leaves
        if time[last] - time[first] < SHORTEST:
            continue
        here = slice(first, last + 1)
        outside = np.flatnonzero(np.linalg.norm(tip[here] - reference[here], axis=1) > band)
        after = 0 if not len(outside) else int(outside[-1]) + 1
        settled = time[first + after] - time[first] if first + after <= last else np.inf
        swing = (np.nan, np.nan) if deflection is None else np.ptp(deflection[here], axis=0).tolist()
        vibration = rms(np.linalg.norm(tip[here] - tip[here].mean(axis=0), axis=1))
        found.append(Rest(float(time[first]), float(time[last]), float(settled), vibration, (swing[0], swing[1])))
    return found


def bending_moment(arm: FlexibleArm, q: Array) -> Array:
    """Return the largest magnitude along each link of the bending moment ``EI w''`` [N m]. Shape (..., 2).

    It follows from the modal coordinates. An arm has no thickness h, hence no strain ``h w'' / 2``; a strain gauge's
    reading is proportional to the moment.

    Args:
        arm: whose shapes and flexural rigidities are taken.
        q: joint angles [rad] and modal coordinates. Shape (..., 2 + 2 m).
    """
    m = arm.parameters.modes_per_link
    peaks = []
    for n, (link, rigidity) in enumerate(zip(arm.modes, arm.parameters.flexural_rigidities, strict=True)):
        curvature = q[..., 2 + n * m : 2 + (n + 1) * m] @ link.curvature(np.linspace(0.0, link.length, PLACES)).T
        peaks.append(rigidity * np.abs(curvature).max(axis=-1))
    return np.stack(peaks, axis=-1)
