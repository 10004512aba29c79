"""Picture of the single links: error of each frequency by number of modes."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from scripts.common.plotting import COLOURS, SOFT, THRESHOLD, WIDTH, headline, save
from scripts.validation.checks import Result
from scripts.validation.links import errors
from scripts.validation.small_motion import BASES, MODES

FLOOR = 1e-16  # an error of 0 is drawn here
LINES = ("-", "--", ":")


def draw(result: Result, folder: Path) -> None:
    """Write the picture."""
    rows = result.findings.records["rows"]
    names = list(dict.fromkeys(row["link"] for row in rows))
    figure, axes = plt.subplots(
        len(BASES), 2, figsize=(WIDTH, 1.6 + 2.6 * len(BASES)), sharex=True, sharey=True, squeeze=False
    )
    for line, basis in zip(axes, BASES, strict=True):
        for axis, root in zip(line, ("clamped", "pinned"), strict=True):
            for row in rows:
                if row["root"] == root:
                    _curves(axis, row, basis, LINES[names.index(row["link"])])
            axis.set(title=f"{root}-free, {basis} shapes", yscale="log", xticks=MODES)
        line[0].set_ylabel("relative error [1]")
        line[1].axhline(0.01, **THRESHOLD)
    for axis in axes[-1]:
        axis.set_xlabel("modes a link")
    for i, colour in enumerate(COLOURS[: len(MODES)]):
        axes[0, 0].plot([], [], "o", color=colour, label=f"frequency {i + 1}")
    for name, style in zip(names, LINES, strict=True):
        axes[0, 0].plot([], [], linestyle=style, color=SOFT, label=name)
    figure.legend(loc="outside lower left", ncol=3)
    headline(figure, "A single link's frequencies against exact beams; dotted: threshold of the check")
    save(figure, folder, "links")


def _curves(axis: Axes, row: dict[str, object], basis: str, style: str) -> None:
    for i, colour in enumerate(COLOURS[: len(MODES)]):
        found = {m: max(abs(errors(row, basis, m)[i]), FLOOR) for m in MODES if i < len(errors(row, basis, m))}
        axis.plot(list(found), list(found.values()), marker="o", linestyle=style, color=colour)
