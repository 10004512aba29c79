"""Laps that are kept for the replays, and how the pictures draw their arm, bent as it was."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from flexarm_env.simulation.arm import FlexibleArm
from scripts.common.plotting import INK
from scripts.docs.replays import FOLDER, channels, file_name, read

Array = NDArray[np.float64]
ARM = FlexibleArm()
PATH = "#b4bcc9"
POINTS = 40  # of a drawn link


class Lap(NamedTuple):
    """A lap, at the instants of its control periods."""

    time: Array  # since its start [s]. Shape (n,)
    q: Array  # joint angles and modal coordinates. Shape (n, 8)
    tip: Array  # where the true tip is [m]. Shape (n, 2)
    sensed: Array  # what the late sensor says [m]. Shape (n, 2)
    reference: Array  # where the tip should be [m]. Shape (n, 2)
    torque: Array  # of the motors [N m]. Shape (n, 2)

    @property
    def away(self) -> Array:
        """Distance of the tip from where it should be [m]. Shape (n,)."""
        return np.asarray(np.linalg.norm(self.tip - self.reference, axis=1))

    def at(self, time: float) -> int:
        """Return the index of the instant that is nearest to a time [s]."""
        return int(np.argmin(np.abs(self.time - time)))


def recorded(row: str, lap: str) -> Lap:
    """Read a lap of a row of the board, as the site replays it."""
    one = read(FOLDER / file_name(row, lap))[2]
    found = channels(one)
    q = np.concatenate([found["joints"], found["modal"]], axis=1)
    sensed, reference, torque = (found[name] for name in ("sensed", "reference", "torque"))
    return Lap(one["interval"] * np.arange(len(q)), q, ARM.tip(q), sensed, reference, torque)


def links(q: Array) -> list[Array]:
    """Return the centre lines of the bent links, root to tip [m]. Shape (POINTS, 2) each."""
    lengths = ARM.parameters.link_lengths
    return [
        np.array([ARM.position(q, link, s) for s in np.linspace(0.0, length, POINTS)])
        for link, length in enumerate(lengths, 1)
    ]


def rigid(q: Array) -> Array:
    """Return shoulder, elbow and tip of straight links at the same joint angles [m]. Shape (3, 2)."""
    turned = np.cumsum(q[:2])
    steps = np.array(ARM.parameters.link_lengths)[:, None] * np.column_stack([np.cos(turned), np.sin(turned)])
    return np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])


def draw_arm(axis: Axes, q: Array, colour: str = INK, width: float = 5.0) -> None:
    """Draw the bent links and their joints."""
    bent = links(q)
    for line in bent:
        axis.plot(*line.T, color=colour, linewidth=width, solid_capstyle="round")
    joints = np.array([bent[0][0], bent[1][0]])
    axis.plot(*joints.T, "o", color="white", markeredgecolor=colour, markersize=1.7 * width, mew=0.4 * width)


def bare(axis: Axes, x: tuple[float, float], y: tuple[float, float]) -> None:
    """Show a part of the plane without axes."""
    axis.set_aspect("equal")
    axis.set_xlim(*x)
    axis.set_ylim(*y)
    axis.set_axis_off()


def draw_path(axis: Axes) -> None:
    """Draw the square that the tip should follow."""
    corners = 6.3 * np.array([(-1, -1), (-1, 1), (1, 1), (1, -1), (-1, -1)])
    axis.plot(*corners.T, color=PATH, linewidth=2.0, zorder=0)
