"""The figures of the task "carry": how the tip comes to rest after each move, and how much the links are stressed."""

from __future__ import annotations

from typing import Any

import numpy as np

from flexarm_agents.board.figures import ERRORS, Figure, Record, of_lap
from flexarm_env.metrics import bending_moment, rests
from flexarm_env.metrics.window import rms

# The vibration is the headline: it still distinguishes entries that have settled as soon as the reference rests.
FIGURES = {
    "vibration": Figure("distance of the tip from its mean place, r.m.s. over the rests", "m"),
    "settling_time": Figure("until the tip stays within 2 cm of the corner, the longest of the rests", "s"),
    "moment": Figure("largest bending moment of a link", "N m"),
    "rms": ERRORS["rms"],
}


def of_rests(view: Any, record: Record) -> dict[str, Any]:
    """Return the figures of a complete lap with rests, `FIGURES` among them; see `figures.of_lap`."""
    found = rests(record["time"], record["true_tip"], record["reference"])
    moments = bending_moment(view.arm, record["state"][:, : view.arm.size])
    return of_lap(view, record) | {
        "vibration": rms([one.vibration for one in found]),
        "settling_time": max(one.settling_time for one in found),
        "moment": float(np.max(moments)),
    }
