"""Picture of the dropped Coriolis terms: energy and trajectory error, over time and by amplitude."""

from __future__ import annotations

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

from scripts.common.plotting import COLOURS, INK, ORANGE, SOFT, WIDTH, headline, save
from scripts.validation.checks import Result
from scripts.validation.coriolis import PULSE, SMALL


def draw(result: Result, folder: Path) -> None:
    """Write the picture."""
    rows, arrays = result.findings.records["rows"], result.findings.arrays
    time = arrays["time"]
    figure, axes = plt.subplots(2, 2, figsize=(WIDTH, 7.8))
    for row, colour in zip(reversed(rows), (*COLOURS, INK), strict=False):
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
        axis.loglog(amplitudes, found, "o-", color=ORANGE)
        slope = 0.4 * found[0] * (amplitudes / amplitudes[0]) ** order
        axis.loglog(amplitudes, slope, color=SOFT, linestyle=":", label=f"order {order}")
        axis.axvspan(min(SMALL), max(SMALL), color="0.9", zorder=0)
        axis.set(xlabel="amplitude of the torque [N m]", ylabel=f"largest error [{unit}]")
        axis.legend()
    for axis in axes[0]:
        axis.axvline(2.0 * PULSE, color=SOFT, linestyle=":")
        axis.set_xlabel("time [s]; torque until the dotted line")
    axes[0, 0].set(title="error of the energy balance", ylabel="share of the energy [1]; thin: complete")
    axes[0, 1].set(title="error of the tip", ylabel="distance from the complete model [m]")
    axes[1, 0].set_title("energy, while the torque lasts")
    axes[1, 1].set_title("tip, while the torque lasts")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncol=4)
    headline(figure, "The paper's forces, without some Coriolis terms, by amplitude of the torque")
    save(figure, folder, "coriolis")
