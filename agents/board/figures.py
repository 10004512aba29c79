"""Figures of an episode of the board, of which less is better: their units, and how they are computed.

A lost episode counts as infinite in every one of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.metrics.lap import figures_of

Record = Mapping[str, NDArray[np.float64]]  # an episode's instants, those of its beginning and its end among them


class Figure(NamedTuple):
    """A figure; less is better."""

    text: str  # what it is
    unit: str  # "m" is shown in mm, every other unit as it is
    title: str = ""  # heading; "": the text

    def plain(self) -> dict[str, str]:
        """Return plain values for a file."""
        return {"title": self.title or self.text, "text": self.text, "unit": self.unit}


ERRORS = {
    "rms": Figure("distance of the tip from the reference, r.m.s. over the lap", "m", "lap"),
    "rms_after_2s": Figure("the same from 2 s on", "m", "after 2 s"),
    "maximum": Figure("largest distance of the tip from the reference", "m", "largest"),
}


def of_lap(view: Any, record: Record) -> dict[str, Any]:
    """Return the figures of a complete lap, `ERRORS` among them, as plain values.

    Args:
        view: environment of the episode (`FlexArmEnvBase`).
        record: "time", "state", "torque", "true_tip", "reference", each of shape (n, ...), and what the task names.
    """
    limit = view.settings.motor_limit
    time, state, torque, tip, reference = (
        record[name] for name in ("time", "state", "torque", "true_tip", "reference")
    )
    return figures_of(
        view.arm, time, state, torque, tip, reference, limit if np.isfinite(limit).all() else None
    ).plain()
