"""Picture of the second engine's convergence."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from scripts.common.plotting import COLOURS, SOFT, THRESHOLD, WIDTH, save
from scripts.validation.checks import Result


def draw(result: Result, folder: Path) -> None:
    """Error of the tip by the elements of a cable."""
    figure, axis = plt.subplots(figsize=(WIDTH, 3.8))
    for row, colour in zip(result.findings.records["rows"], COLOURS, strict=False):
        errors = 1e3 * np.array(list(row["elements"].values()))
        axis.loglog(
            [int(n) for n in row["elements"]], errors, "o-", color=colour, label=row["programme"].replace("_", " ")
        )
    counts = np.array([2.0, 12.0])
    axis.loglog(counts, 30.0 * counts**-4.0, color=SOFT, linestyle="--", label="order 4")
    axis.axhline(0.1, **THRESHOLD)
    axis.text(2.0, 0.11, "threshold of the check", color=SOFT)
    axis.set(xlabel="elements a cable", ylabel="largest change of the tip [mm]")
    axis.set_title("How far the tip moves when Exudyn's cables have more elements")
    axis.set_xticks([2, 3, 4, 6, 8, 12], ["2", "3", "4", "6", "8", "12"])
    axis.minorticks_off()
    axis.legend()
    save(figure, folder, "cables")
