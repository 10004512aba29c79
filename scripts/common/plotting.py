"""One look for all pictures that the scripts draw: its letters have nine points or more where a page shows them."""

import io
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")  # files only; no display needed
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter
from numpy.typing import NDArray
from PIL import Image  # matplotlib brings it
from scipy.ndimage import uniform_filter1d
from scipy.stats import bootstrap, trim_mean

from flexarm_agents.files import put

WIDTH = 8.0  # of a figure [in]. The site shows it on 7.3 in, so that the least letters, of 10 points, have 9 there.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")  # Okabe and Ito
BLUE, ORANGE, GREEN = COLOURS[:3]
INK, SOFT = "#1d2433", "#5b6576"  # of lines and words that are no data
THRESHOLD: dict[str, Any] = {"color": SOFT, "linestyle": ":", "linewidth": 1.4}
PALETTE = 200  # colours of a PNG, which takes a third of the room then

plt.rcParams.update(
    {
        "font.size": 10.5,
        "axes.titlesize": 11,
        "axes.titlelocation": "left",
        "figure.titlesize": 12,
        "axes.grid": True,
        "grid.alpha": 0.25,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "legend.frameon": False,
        "figure.constrained_layout.use": True,
        "figure.constrained_layout.w_pad": 0.08,
        "figure.constrained_layout.h_pad": 0.08,
        "savefig.dpi": 140,
        "svg.fonttype": "none",  # text stays text
        "svg.hashsalt": "flexarm",  # equal pictures are equal files
    }
)


def headline(figure: Figure, text: str) -> None:
    """Write what a picture of several panels compares."""
    figure.suptitle(text, x=0.01, ha="left")


def save(figure: Figure, folder: Path, name: str) -> None:
    """Write PNG and SVG, and close the figure."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # laid out once, for both
    figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
    write(figure, folder / f"{name}.png")


def write(figure: Figure, path: Path) -> None:
    """Write a PNG, and close the figure."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with io.BytesIO() as file:
        figure.savefig(file, format="png")
        picture = Image.open(file).convert("RGB").quantize(PALETTE, dither=Image.Dither.NONE)
    put(path, lambda aside: picture.save(aside, format="PNG", optimize=True))
    plt.close(figure)


def write_moving(path: Path, pictures: Iterable[Image.Image], interval: float, rest: float, **look: Any) -> None:
    """Write pictures as an animated WebP, which repeats; times from one to the next, and on the last one, in s."""
    first, *others = pictures
    durations = [round(1e3 * interval)] * len(others) + [round(1e3 * rest)]
    shown: dict[str, Any] = {"save_all": True, "append_images": others, "duration": durations, "loop": 0}
    put(path, lambda aside: first.save(aside, **shown, quality=60, method=6, **look))


def plain_ticks(axis: Axis) -> None:
    """Put plain numbers to a logarithmic axis."""
    axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_formatter(NullFormatter())


def number_ticks(axis: Axis, ticks: Sequence[float]) -> None:
    """Write numbers at some places of an axis, and nothing between them."""
    axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
    axis.set_ticks([], minor=True)


def plot_interquartile_mean(axis: Axes, x: Any, several: Any, **look: Any) -> float:
    """Draw the interquartile mean of several errors [m] over x in millimetres, with its interval of 95 %.

    The interval is a percentile bootstrap over the trainings (Agarwal et al., NeurIPS 2021). Errors are infinite where
    lost, which leaves gaps. Return where the line ends [mm].
    """
    errors = 1e3 * np.array(several, float)
    mean = trim_mean(errors, 0.25, axis=0)
    axis.plot(x, mean, **look)
    if len(errors) > 1:
        with np.errstate(invalid="ignore"):  # between two infinite errors
            interval = bootstrap((errors,), partial(trim_mean, proportiontocut=0.25), method="percentile", rng=0)
        low, high = interval.confidence_interval
        shown = np.isfinite(low) & np.isfinite(high)
        axis.fill_between(np.asarray(x), low, high, where=shown, color=look["color"], alpha=0.15, linewidth=0.0)
    return float(mean[np.isfinite(mean)][-1]) if np.isfinite(mean).any() else axis.get_ylim()[1]


def running_rms(values: Any, window: int) -> NDArray[np.float64]:
    """Return the r.m.s. of values over a window about each instant: the size of what oscillates. Shape (n,)."""
    return np.sqrt(uniform_filter1d(np.square(values), window, mode="nearest"))


def label_ends(axis: Axes, labels: Sequence[tuple[str, str]], heights: Sequence[float]) -> None:
    """Write the names of lines at the axis' right side, moved apart where they would overlap."""
    figure = axis.get_figure(root=True)
    assert figure is not None
    figure.draw_without_rendering()  # lays the axes out, so that their height is known
    lines = np.array([1.0 + text.count("\n") for text, _ in labels])
    sizes = lines * 1.25 * plt.rcParams["font.size"] / 72.0 * figure.dpi / axis.bbox.height
    ends = axis.transAxes.inverted().transform(axis.transData.transform([(1.0, height) for height in heights]))[:, 1]
    order = np.argsort(ends)
    at = np.clip(ends, 0.0, 1.0)
    for before, n in zip(order[:-1], order[1:], strict=True):
        at[n] = max(at[n], at[before] + 0.5 * (sizes[before] + sizes[n]))
    top = 1.0 + 0.5 * sizes[order[-1]]
    for n, above in zip(order[::-1], [None, *order[:0:-1]], strict=True):
        at[n] = min(at[n], top - 0.5 * sizes[n] if above is None else at[above] - 0.5 * (sizes[above] + sizes[n]))
    for (text, colour), height in zip(labels, at, strict=True):
        axis.text(1.015, height, text, color=colour, transform=axis.transAxes, va="center", linespacing=1.1)
