"""Exact delay margins of the entries whose loop is linear: the paper's law with a constant gain on a late sensor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from flexarm_agents.board.entries import Entry
from flexarm_baselines import IFDC
from flexarm_env.analysis import delay_margin, law_loop
from flexarm_env.envs.settings import Settings
from flexarm_env.parameters import SquareParameters
from flexarm_env.physics.paths import square

PLACES = 5  # on half a side of the square; the other sides repeat it


def delay_margins(entry: Entry) -> Mapping[str, float] | None:
    """Return the least and the largest delay margin along the square [s], by the linear theory of an arm at rest.

    Returns:
        "least" and "most"; None for an entry whose loop is not linear, or does not contain the sensor.
    """
    candidate = entry.candidate()
    settings: Any = candidate.env.unwrapped.settings  # type: ignore[attr-defined]
    assert isinstance(settings, Settings)
    if not isinstance(candidate.policy, IFDC) or settings.law_sensor != "sensor":
        return None
    path = square(SquareParameters())
    places = path.position(np.linspace(0.0, path.lap_time / 8.0, PLACES))
    # the axis has one delay for both joints
    sensor = replace(settings.sensor_parameters, delay=max(settings.sensor_delays))
    gain = candidate.policy.gain
    loops = [law_loop(settings.flexible_arm, place, sensor, gain) for place in places]
    found = [delay_margin(loop).delay for loop in loops]
    return {"least": min(found), "most": max(found)}
