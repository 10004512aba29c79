"""Picture of the dropped Coriolis terms: energy and trajectory error, over time and by amplitude."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from scripts.common.plotting import COLOURS, save
from scripts.validation.checks import Result
from scripts.validation.coriolis import PULSE, SMALL


def draw(result: Result, folder: Path) -> None:
    """Write the picture."""
    rows, arrays = result.findings.records["rows"], result.findings.arrays
    time = arrays["time"]
    figure, axes = plt.subplots(2, 2, figsize=(12, 8))
    for row, colour in zip(reversed(rows), (*COLOURS, "#111111"), strict=False):
        amplitude = row["amplitude"]
        error = np.abs(arrays[f"balance rigid {amplitude}"]) / row["energy"]
        away = arrays[f"away {amplitude}"]
        axes[0, 0].semilogy(time[1 : len(error)], error[1:], color=colour, label=f"{amplitude:g} N m")
        axes[0, 1].semilogy(time[1 : len(away)], away[1:], color=colour)
        late = np.abs(arrays[f"balance complete {amplitude}"]) / row["energy"]
        axes[0, 0].semilogy(time[1 : len(late)], np.maximum(late[1:], 1e-16), color=colour, linewidth=0.6, alpha=0.5)
    amplitudes = np.array([row["amplitude"] for row in rows])
    for axis, what, order, unit in ((axes[1, 0], "rigid_balance", 3, "J"), (axes[1, 1], "away", 2, "m")):
        found = np.array([row[what] for row in rows])
        axis.loglog(amplitudes, found, "o-", color=COLOURS[1], label="paper's forces, until the doublet ends")
        slope = 0.4 * found[0] * (amplitudes / amplitudes[0]) ** order
        axis.loglog(amplitudes, slope, color="0.4", linestyle=":", label=f"order {order}")
        axis.axvspan(min(SMALL), max(SMALL), color="0.9", zorder=0)
        axis.set(xlabel="amplitude of the doublet [N m]", ylabel=f"largest error [{unit}]")
        axis.legend()
    for axis in axes[0]:
        axis.axvline(2.0 * PULSE, color="0.35", linestyle=":")
        axis.set_xlabel("time [s] (torque until the dotted line)")
    axes[0, 0].set(title="energy minus work / energy; thin: complete forces")
    axes[0, 1].set(title="tip's distance from that of the complete model [m]")
    axes[1, 0].set_title("energy error by amplitude")
    axes[1, 1].set_title("trajectory error by amplitude")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncol=7)
    save(figure, folder, "coriolis")
