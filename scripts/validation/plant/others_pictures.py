"""Draws how far the default arm is from the chain under each controller of the group "controllers"."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scripts.common.plotting import COLOURS, INK, SOFT
from scripts.validation.checks import Result
from scripts.validation.plant.pictures import LOST, over_time


def draw(result: Result, folder: Path) -> None:
    """Draw the distance over time, until the tip is lost."""
    names = list(dict.fromkeys(name.partition(", ")[2] for name in result.findings.arrays))
    colours = dict(zip(names, (*COLOURS, INK, SOFT), strict=False))
    lines = {}
    for name, away in result.findings.arrays.items():
        lap, _, controller = name.partition(", ")
        lost = np.flatnonzero(away > LOST)
        text = f"{controller}\n(lost)" if lost.size else controller
        lines[lap, (text, colours[controller])] = away[: lost[0] + 1] if lost.size else away
    title = "Distance of the default arm's tip from the MuJoCo chain's under each controller"
    over_time(lines, title, folder, "controllers_distance")
