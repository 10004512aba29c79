"""One look for all pictures that the scripts draw."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")  # files only; no display needed
import matplotlib.pyplot as plt
from matplotlib.figure import Figure

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")  # Okabe and Ito
THRESHOLD: dict[str, Any] = {"color": "0.35", "linestyle": ":", "linewidth": 1.4}

plt.rcParams.update(
    {
        "font.size": 11,
        "axes.grid": True,
        "grid.alpha": 0.25,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "legend.frameon": False,
        "figure.constrained_layout.use": True,
        "savefig.dpi": 110,
        "svg.fonttype": "none",  # text stays text
        "svg.hashsalt": "flexarm",  # equal pictures are equal files
    }
)


def save(figure: Figure, folder: Path, name: str) -> None:
    """Write PNG and SVG."""
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # laid out once, for both
    figure.savefig(folder / f"{name}.png")
    figure.savefig(folder / f"{name}.svg", metadata={"Date": None})
    plt.close(figure)
