"""Pictures of how far arms are from the chain over a lap."""

from __future__ import annotations

from collections.abc import Mapping

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexarm_env.laps import LAPS
from scripts.common.plotting import WIDTH, headline, label_ends, plain_ticks, running_rms
from tests.validation.laps import PERIODS
from tests.validation.programmes import HELD

WINDOW = 50  # control periods: half a second


def over_time(lines: Mapping[tuple[str, tuple[str, str]], NDArray[np.float64]], title: str) -> Figure:
    """Draw distances over a lap, one panel a lap.

    Args:
        lines: distances in each control period [m], as far as the laps go, by lap, and by text and colour of the line.
        title: title of the picture.
    """
    figure, axes = plt.subplots(len(LAPS), figsize=(WIDTH, 6.4), sharex=True)
    for axis, lap in zip(axes, LAPS, strict=True):
        own = {look: 1e3 * running_rms(away, WINDOW) for (one, look), away in lines.items() if one == lap}
        for (_, colour), away in own.items():
            axis.semilogy(HELD * PERIODS * np.arange(len(away)), away, color=colour, linewidth=1.6)
        axis.set(title=f"{lap} lap", ylabel="r.m.s. over 0.5 s [mm]", ylim=(0.5, 1000.0), xlim=(0.0, 16.0))
        plain_ticks(axis.yaxis)
        axis.set_xticks(range(0, 17, 4))
        label_ends(axis, [*own], [away[-1] for away in own.values()])
    axes[-1].set_xlabel("time [s]")
    headline(figure, title)
    return figure
