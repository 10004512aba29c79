"""Pictures of the arm: its first second in slow motion, the same in steps of 0.3 s, and what its terms mean.

It is drawn as it was bent in laps that are kept for the replays.
"""

import io
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Arc
from numpy.typing import NDArray
from PIL import Image

from flexarm_env.simulation.arm import FlexibleArm
from scripts.common.plotting import BLUE, GREEN, INK, ORANGE, SOFT, WIDTH, write, write_moving
from scripts.docs.replays import FOLDER, channels, file_name, read

Array = NDArray[np.float64]
ARM = FlexibleArm()
PATH = "#b4bcc9"
POINTS = 40  # of a drawn link
COMPARED = {
    "flsac": "FLSAC: the paper's fuzzy controller",
    "agent student_unknown": "student_unknown: a trained network",
}
LAP = "swing"
LAST, SLOWER, PERIOD = 1.0, 8, 0.01  # of the moving picture: time [s], times as slow as the arm, between frames [s]
REST = 2.0  # on the last frame [s]
STILL = (0.0, 0.3, 0.6, 0.9, 1.2)  # [s]
MOMENT = 0.3  # of the labelled drawing [s]
PURPLE = "#8a3b8f"
LABEL: dict[str, Any] = {"bbox": {"facecolor": "white", "edgecolor": "none", "pad": 1.0}, "zorder": 1}
LETTERS = "#b04d00"  # orange with enough contrast for letters
NARROW: dict[str, Any] = {"linestyle": (0, (4, 3)), "linewidth": 1.3, "color": SOFT}
X, Y = (-8.4, 0.9), (-7.3, 1.3)  # what is shown of the plane [m]


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
    return [ARM.position(q, link, np.linspace(0.0, length, POINTS)) for link, length in enumerate(lengths, 1)]


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


def moving(path: Path) -> None:
    """Draw the first second of the swing lap under two controllers, in slow motion, as an animated WebP."""
    laps = {title: recorded(row, LAP) for row, title in COMPARED.items()}
    frames = (_frame(laps, float(time)) for time in np.arange(0.0, LAST + 1e-9, PERIOD))
    write_moving(path, frames, SLOWER * PERIOD, REST)


def _frame(laps: dict[str, Lap], time: float) -> Image.Image:
    figure, axes = plt.subplots(1, 2, figsize=(9.6, 5.0), dpi=100)
    for axis, (title, lap) in zip(axes, laps.items(), strict=True):
        now = lap.at(time)
        bare(axis, X, Y)
        axis.set_title(title, fontsize=14, color=INK)
        draw_path(axis)
        axis.plot(*rigid(lap.q[now]).T, **NARROW)
        draw_arm(axis, lap.q[now])
        axis.plot(*lap.tip[: now + 1].T, color=ORANGE, linewidth=2.0)
        marks(axis, lap, now)
        axis.text(0.7, -5.9, f"tip {lap.away[now]:.2f} m off", ha="right", fontsize=17, color=LETTERS)
        axis.text(0.7, 0.55, "shoulder", ha="right", fontsize=12, color=INK)
        axis.text(-6.15, 0.3, "path", fontsize=12, color=SOFT)
    left, lap = axes[0], next(iter(laps.values()))
    now = lap.at(time)
    look: dict[str, Any] = {"textcoords": "offset points", "fontsize": 13}
    left.annotate("target", lap.reference[now], (-13, 0), ha="right", va="center", color=BLUE, **look)
    left.annotate("tip", lap.tip[now], (9, -13), color=LETTERS, **look)
    left.text(0.7, -7.1, f"{time:.2f} s", ha="right", fontsize=17, color=INK)
    left.text(-6.3, -7.1, f"{SLOWER} times slower", fontsize=12, color=SOFT)
    axes[1].text(0.7, -7.1, "dashed: rigid links, same joint angles", ha="right", fontsize=12, color=SOFT)
    return image(figure)


def marks(axis: Axes, lap: Lap, now: int) -> None:
    """Mark the true tip and where it should be."""
    tip, target = lap.tip[now], lap.reference[now]
    axis.plot(*target, "o", markersize=15, markerfacecolor="none", color=BLUE, markeredgewidth=2.4)
    axis.plot(*tip, "o", markersize=9, color=ORANGE)


def image(figure: Figure) -> Image.Image:
    """Return a figure as a picture, and close it."""
    with io.BytesIO() as file:
        figure.savefig(file, format="png", dpi=figure.dpi)
        plt.close(figure)
        return Image.open(file).convert("RGB")


def still(path: Path) -> None:
    """Draw the same two laps in steps of 0.3 s."""
    figure, axes = plt.subplots(1, 2, figsize=(WIDTH, 4.4))
    for axis, (row, title) in zip(axes, COMPARED.items(), strict=True):
        lap = recorded(row, LAP)
        bare(axis, X, (-7.3, 2.6))
        axis.set_title(title, color=INK)
        draw_path(axis)
        last = lap.at(STILL[-1])
        axis.plot(*lap.tip[: last + 1].T, color=ORANGE, linewidth=1.6)
        for time, shade in zip(STILL, ("0.78", "0.64", "0.48", "0.32", "0.12"), strict=True):
            now = lap.at(time)
            draw_arm(axis, lap.q[now], shade, 3.5)
            axis.plot(*lap.reference[now], "o", markersize=11, markerfacecolor="none", color=BLUE, markeredgewidth=1.8)
            axis.plot(*lap.tip[now], "o", markersize=7, color=ORANGE)
            look: dict[str, Any] = {"textcoords": "offset points", "color": BLUE}
            axis.annotate(f"{time:g} s", lap.reference[now], (-10, 0), ha="right", va="center", **look)
    write(figure, path)


def terms(path: Path) -> None:
    """Draw the arm at a bent moment with its terms; the tip enlarged; and where the two laps begin."""
    lap = recorded("lqg", LAP)
    now = lap.at(MOMENT)
    figure = plt.figure(figsize=(WIDTH, 4.8))
    grid = figure.add_gridspec(2, 2, width_ratios=(1.55, 1.0))
    _whole(figure.add_subplot(grid[:, 0]), lap, now)
    _tip(figure.add_subplot(grid[0, 1]), lap, now)
    _starts(figure.add_subplot(grid[1, 1]))
    write(figure, path)


def _whole(axis: Axes, lap: Lap, now: int) -> None:
    q = lap.q[now]
    straight, (one, two) = rigid(q), links(q)
    bare(axis, (-9.3, 2.8), (-7.4, 1.6))
    draw_path(axis)
    axis.plot(*straight.T, **NARROW)
    tangent = one[-1] - one[-2]
    tangent *= 2.6 / np.linalg.norm(tangent)
    axis.plot(*np.stack([one[-1], one[-1] + tangent]).T, color=SOFT, linewidth=1.0, linestyle=":")
    axis.plot((0.0, 2.6), (0.0, 0.0), color=SOFT, linewidth=1.0, linestyle=":")
    draw_arm(axis, q)
    angles = np.degrees([q[0], np.arctan2(*tangent[::-1]), np.arctan2(*(two[1] - two[0])[::-1])])
    axis.add_patch(Arc((0.0, 0.0), 3.0, 3.0, theta1=angles[0], theta2=0.0, color=GREEN, linewidth=2.0))
    axis.add_patch(Arc(tuple(one[-1]), 2.8, 2.8, theta1=angles[2], theta2=angles[1], color=GREEN, linewidth=2.0))
    axis.plot(*lap.tip[now], "o", markersize=9, color=ORANGE)
    axis.plot(*straight[-1], "s", markersize=7, color=SOFT)
    _say(axis, (0.3, 0.45), "shoulder")
    _say(axis, np.add(one[-1], (0.4, -0.35)), "elbow", va="top")
    _say(axis, np.add(one[POINTS // 2], (0.35, -0.5)), "link 1 bends")
    _say(axis, (1.0, -1.6), "theta1", GREEN)
    _say(axis, np.add(one[-1] + 0.72 * tangent, (0.3, -0.1)), "theta2", GREEN)
    _say(axis, np.add(straight[-1], (-0.9, 0.4)), "rigid tip", SOFT)
    _say(axis, np.add(straight[1], (-0.5, 0.45)), "rigid links", SOFT, ha="right")
    _say(axis, np.add(two[POINTS // 2], (0.2, -0.6)), "link 2", va="top", ha="right")
    _say(axis, np.add(lap.tip[now], (-0.3, 0.3)), "true tip", LETTERS, ha="right")
    _say(axis, (2.8, -6.5), "path of the tip", SOFT, ha="right", va="top")


def _say(axis: Axes, at: Any, text: str, colour: str = INK, **look: Any) -> None:
    x, y = at
    axis.text(x, y, text, color=colour, **LABEL | look)


def _tip(axis: Axes, lap: Lap, now: int) -> None:
    tip, sensed, target = lap.tip[now], lap.sensed[now], lap.reference[now]
    bare(axis, (tip[0] - 0.65, tip[0] + 0.85), (tip[1] - 0.6, tip[1] + 0.4))
    axis.set_title("the tip, enlarged", color=INK)
    draw_path(axis)
    axis.plot(*lap.tip[: now + 1].T, color=ORANGE, linewidth=1.6)
    draw_arm(axis, lap.q[now])
    axis.plot(*target, "o", markersize=13, markerfacecolor="none", color=BLUE, markeredgewidth=2.0)
    axis.plot(*sensed, "D", markersize=9, color=PURPLE)
    axis.plot(*tip, "o", markersize=11, color=ORANGE)
    _say(axis, np.add(tip, (-0.06, 0.05)), "true tip", LETTERS, ha="right")
    _say(axis, np.add(sensed, (0.07, -0.02)), "late reading:\n31 ms old", PURPLE, va="top")
    _say(axis, np.add(target, (0.08, -0.03)), "target", BLUE, va="top")


def _starts(axis: Axes) -> None:
    bare(axis, (-7.5, 1.0), (-7.3, 0.5))
    axis.set_title("where the two laps begin", color=INK)
    draw_path(axis)
    for lap, colour, side in (("plain", SOFT, -1.0), ("swing", INK, 1.0)):
        q = recorded("lqg", lap).q[0]
        draw_arm(axis, q, colour, 3.5)
        text = f"{lap} lap:\ntheta2 {'<' if side < 0.0 else '>'} 0"
        look = {"ha": "right", "va": "bottom"} if side > 0.0 else {"ha": "left", "va": "top"}
        _say(axis, np.add(rigid(q)[1], (-0.2 * side, 0.2 * side)), text, colour, **look)
    axis.annotate("", (-6.3, -3.6), (-6.3, -6.2), arrowprops={"arrowstyle": "-|>", "color": BLUE, "linewidth": 2.4})
    _say(axis, (-6.5, -4.9), "target", BLUE, rotation=90, ha="right", va="center")
