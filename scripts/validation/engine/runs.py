"""One programme on a chain of another engine."""

from __future__ import annotations

import numpy as np

from scripts.validation.engine.chain import CHAIN_ANGLE, EngineChain
from scripts.validation.engine.motion import Motion
from scripts.validation.engine.programmes import Programme


def chain_motion(programme: Programme, elements: int, angle: float = CHAIN_ANGLE) -> Motion:
    """Run a programme on a chain.

    Args:
        programme: the programme.
        elements: bending elements a link.
        angle: see `EngineChain`.
    """
    arm = EngineChain(elements, programme.parameters(), angle)
    arm.place(programme.joints, programme.pull)
    arm.data.qvel[0] = programme.spin
    sights = [arm.look()]
    for torque in programme.torques():
        arm.advance(torque)
        sights.append(arm.look())
    return Motion(*(np.array([getattr(sight, name) for sight in sights]) for name in Motion._fields))
