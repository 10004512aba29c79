"""Four controllers side by side, as a small animated picture."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.animation import FuncAnimation, PillowWriter

from flexarm_agents.run_folder import put
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.trajectory import Trajectory
from scripts.common.plotting import COLOURS

PICTURES_PER_SECOND = 10
SPEED = 2.0  # times as fast as the arm
POINTS = 12  # of a drawn link
TRACE = 3.0  # [s]; so much of the tip's path is shown


def animate(runs: Mapping[str, Trajectory], path: Path) -> None:
    """Draw the arms, their tips' paths and the reference.

    Args:
        runs: a lap of each controller, by its name.
        path: of the GIF.
    """
    figure, axes = plt.subplots(1, len(runs), figsize=(2.0 * len(runs), 2.3), dpi=80, squeeze=False)
    lines = []
    for axis, (name, run), colour in zip(axes[0], runs.items(), COLOURS, strict=False):
        assert run.reference is not None
        axis.plot(*run.reference.T, color="0.75", linewidth=0.8)
        axis.set_title(name, fontsize=9)
        axis.set_aspect("equal")
        axis.set_xlim(-7.4, 7.4)
        axis.set_ylim(-7.4, 7.4)
        axis.set_axis_off()
        (trace,) = axis.plot([], [], color=colour, linewidth=1.0)
        (arm,) = axis.plot([], [], color="black", linewidth=1.6)
        (target,) = axis.plot([], [], marker="o", markersize=3, color="0.4")
        lines.append((run, _shape(run), run.reference, trace, arm, target))
    end = max(run.time[-1] for run in runs.values())

    def show(frame: int) -> list[Any]:
        """Move every row's lines to a frame."""
        time = frame * SPEED / PICTURES_PER_SECOND
        for run, shape, points, trace, arm, target in lines:
            now = min(int(np.searchsorted(run.time, time)), len(run) - 1)
            first = int(np.searchsorted(run.time, time - TRACE))
            trace.set_data(*run.tip[min(first, now) : now + 1].T)
            arm.set_data(*shape[now].T)
            target.set_data(*points[now : now + 1].T)
        return []

    frames = int(end * PICTURES_PER_SECOND / SPEED) + 1
    moving = FuncAnimation(figure, show, frames=frames)
    put(path, lambda aside: moving.save(aside, writer=PillowWriter(fps=PICTURES_PER_SECOND)))
    plt.close(figure)


def _shape(run: Trajectory) -> Any:
    """Return points of both bent links at each instant [m]. Shape (n, 2 POINTS, 2)."""
    arm = FlexibleArm(run.parameters)
    q = run.state[:, : arm.size]
    places = [(link, x) for link in (1, 2) for x in np.linspace(0.0, arm.parameters.link_lengths[link - 1], POINTS)]
    return np.stack([arm.position(q, link, x) for link, x in places], axis=1)
