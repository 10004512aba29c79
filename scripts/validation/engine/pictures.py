"""Pictures of the comparison with MuJoCo's chain: convergence, errors over time, validity, the square."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np

from scripts.common.plotting import (
    BLUE,
    COLOURS,
    GREEN,
    INK,
    ORANGE,
    SOFT,
    THRESHOLD,
    WIDTH,
    headline,
    plain_ticks,
    running_rms,
    save,
)
from scripts.validation.checks import Array, Result
from scripts.validation.engine.models import DEFAULT
from scripts.validation.engine.programmes import PROGRAMMES

TITLES = {programme.name: programme.title for programme in PROGRAMMES}
DRIVERS = {"ifdc": "IFDC, undamped", "flsac": "FLSAC, undamped"}
WINDOW = 100  # instants of 1 ms
LINES = {  # the models that are drawn over time
    "linear, 2 modes": ("linear arm: 2 modes", ORANGE),
    "foreshortened, 3 modes": ("links keep their length, 3 modes", GREEN),
    DEFAULT.label: ("default arm: 3 polynomials", BLUE),
    "foreshortened, 4 polynomials": ("4 polynomials", COLOURS[5]),
}
FINEST = "the chain of 40 elements, against its limit"
PERCENT = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
LIMIT = 10.0  # [mm], drawn as the threshold


def draw(result: Result, folder: Path) -> None:
    """Write all pictures."""
    records, arrays = result.findings.records, dict(result.findings.arrays)
    convergence(records, folder)
    programmes(arrays, folder)
    validity(records, arrays, folder)
    on_the_square(records, arrays, folder)


def convergence(records: Mapping[str, Any], folder: Path) -> None:
    """Tip error of chains by elements; of models by modes, at the smallest and at full amplitude."""
    rows = records["convergence"]
    figure, axes = plt.subplots(1, 3, figsize=(WIDTH, 5.6))
    for row, colour in zip(rows, COLOURS, strict=False):
        counts = [int(n) for n in row["tip"]]
        errors = [1e3 * row["tip"][str(n)] for n in counts]
        axes[0].loglog(counts, errors, "o-", markersize=4, color=colour, label=TITLES[row["programme"]])
    counts = sorted({int(n) for row in rows for n in row["tip"]})
    axes[0].loglog(counts, [100.0 / n**2 for n in counts], **THRESHOLD, label="second order")
    axes[0].set_xticks(counts, [str(n) for n in counts])
    axes[0].minorticks_off()
    axes[0].set(title="the chain's own error", xlabel="elements a link", ylabel="tip error [mm]")
    smallest = min(row["amplitude"] for row in records["errors"])
    for axis, amplitude in zip(axes[1:], (smallest, 1.0), strict=True):
        _by_modes(axis, [row for row in records["errors"] if row["amplitude"] == amplitude])
        bend = 100.0 * max(row["bend"] for row in records["errors"] if row["amplitude"] == amplitude)
        axis.set(title=f"models, bent by {bend:.2g} %", xlabel="shapes a link", xticks=range(1, 5), ylim=(1e-4, 100.0))
    for name, style in (("linear arm, modes", "-"), ("links keep length, modes", "--"), ("the same, polynomials", ":")):
        axes[2].plot([], [], color=SOFT, linestyle=style, label=name)
    handles = [pair for axis in (axes[0], axes[2]) for pair in zip(*axis.get_legend_handles_labels(), strict=True)]
    figure.legend(*zip(*handles, strict=True), loc="outside lower left", ncols=3)
    headline(figure, "Tip errors of the chain (largest) and of models against it (r.m.s.)")
    save(figure, folder, "engine_convergence")


def _by_modes(axis: Any, rows: list[dict[str, Any]]) -> None:
    kinds = (("linear", "mode", "-"), ("foreshortened", "mode", "--"), ("foreshortened", "polynomial", ":"))
    for name, colour in zip(dict.fromkeys(row["programme"] for row in rows), COLOURS, strict=False):
        for kinematics, shape, style in kinds:
            here = {
                int(row["model"].split()[1]): 1e3 * row["rms"]
                for row in rows
                if row["programme"] == name and row["model"].startswith(kinematics) and shape in row["model"]
            }
            if here:
                axis.semilogy(list(here), list(here.values()), marker="o", markersize=4, linestyle=style, color=colour)


def programmes(arrays: dict[str, Array], folder: Path) -> None:
    """Tip error over time of some models, a panel for each programme."""
    names = [name for name in TITLES if f"{name} time" in arrays]
    lines = -(-len(names) // 2)
    figure, axes = plt.subplots(lines, 2, figsize=(WIDTH, 1.4 + 2.3 * lines), sharey=True, squeeze=False)
    for axis in axes.flat[len(names) :]:
        axis.remove()
    for name, axis in zip(names, axes.flat, strict=False):
        chains = [key for key in arrays if key.startswith(f"{name} chain")]
        finest = max(chains, key=lambda key: int(key.split()[-1]))
        for key, (label, colour) in {f"{name} {model}": look for model, look in LINES.items()}.items():
            if key in arrays:
                axis.semilogy(arrays[f"{name} time"], _size(arrays[key]), color=colour, linewidth=1.8, label=label)
        axis.semilogy(arrays[f"{name} time"], _size(arrays[finest]), color=SOFT, linestyle=":", label=FINEST)
        axis.set(title=TITLES[name], ylim=(1e-3, 2e2))
        axis.set_yticks([0.001, 0.01, 0.1, 1, 10, 100], ["0.001", "0.01", "0.1", "1", "10", "100"])
        axis.set_yticks([], minor=True)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    for line in axes:
        line[0].set_ylabel("tip error [mm]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=2)
    headline(figure, "Distance of each model's tip from the MuJoCo chain's, r.m.s. over 0.1 s")
    save(figure, folder, "engine_programmes")


def _size(error: Array) -> Array:
    """Return the r.m.s. over a tenth of a second in mm; what is exactly zero is not drawn."""
    size = 1e3 * running_rms(error, WINDOW)
    return np.where(size > 0.0, size, np.nan)


def validity(records: Mapping[str, Any], arrays: dict[str, Array], folder: Path) -> None:
    """Error by deflection in the programmes; and by deflection and spin."""
    figure, axes = plt.subplots(2, 2, figsize=(WIDTH, 8.4), sharey="row", sharex="row")
    for axis, label in zip(axes[0], ("linear, 2 modes", DEFAULT.label), strict=True):
        for name, colour in zip(TITLES, COLOURS, strict=True):
            rows = [row for row in records["errors"] if (row["programme"], row["model"]) == (name, label)]
            bends, errors = [100.0 * row["bend"] for row in rows], [1e3 * row["rms"] for row in rows]
            axis.loglog(bends, errors, "o-", markersize=4, color=colour, label=TITLES[name])
        axis.axhline(LIMIT, **THRESHOLD)
        axis.set(title=LINES[label][0], xlabel="largest deflection / length [%]", xlim=(0.4, 20.0), ylim=(1e-3, 5e3))
        axis.set_xticks(PERCENT, [f"{x:g}" for x in PERCENT])
        axis.set_xticks([], minor=True)
    spins = np.broadcast_to(arrays["map spins"][:, None], arrays["map bends"].shape)
    for axis, label in zip(axes[1], ("linear, 2 modes", "foreshortened, 3 modes"), strict=True):
        mapped = np.minimum(1e3 * arrays.get(f"map {label}", np.full(spins.shape, np.nan)), 1e6)
        for outside, mark, colour in ((mapped <= LIMIT, "o", BLUE), (mapped > LIMIT, "x", ORANGE)):
            axis.plot(spins[outside], 100.0 * arrays["map bends"][outside], mark, color=colour, markersize=7)
        axis.set(title=LINES[label][0], yscale="log", xlabel="spin / first clamped frequency [1]", ylim=(0.2, 25.0))
        axis.set_yticks(PERCENT, [f"{x:g}" for x in PERCENT])
        axis.set_yticks([], minor=True)
    axes[0, 0].set_ylabel("r.m.s. tip error [mm]")
    axes[1, 0].set_ylabel("largest deflection / length [%]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    headline(
        figure,
        "Where models are valid. Above: error by deflection, dotted line at 10 mm.\n"
        "Below: a spinning, vibrating arm; dots: below 10 mm, crosses: above",
    )
    save(figure, folder, "engine_validity")


def on_the_square(records: Mapping[str, Any], arrays: dict[str, Array], folder: Path) -> None:
    """Draw the chain's lap, and some models' distance from it over time."""
    labels = dict.fromkeys(row["model"] for row in records["square"] if not row["model"].startswith("chain"))
    figure, axes = plt.subplots(2, len(DRIVERS), figsize=(WIDTH, 7.6), height_ratios=(1.2, 1.0), sharey="row")
    for (driver, title), (path, error) in zip(DRIVERS.items(), axes.T, strict=True):
        tip = arrays[f"{driver} chain"]
        path.plot(*tip.T, color=INK, linewidth=1.2)
        path.plot([-6.3, -6.3, 6.3, 6.3, -6.3], [-6.3, 6.3, 6.3, -6.3, -6.3], **THRESHOLD)
        path.set(title=f"{title}: the chain's tip", aspect="equal", xlabel="x [m]")
        for label in labels:
            if label in LINES:
                away = _size(arrays[f"{driver} {label}"])
                text, colour = LINES[label]
                error.semilogy(1e-3 * np.arange(len(away)), away, color=colour, linewidth=1.6, label=text)
        error.set(xlabel="time [s]", ylim=(0.1, 2e3))
        plain_ticks(error.yaxis)
    axes[0, 0].set_ylabel("y [m]")
    axes[1, 0].set_ylabel("tip from the chain's,\nr.m.s. over 0.1 s [mm]")
    figure.legend(*axes[1, 0].get_legend_handles_labels(), loc="outside lower left", ncols=2)
    headline(figure, "The paper's laws on the MuJoCo chain, and how far models are from it")
    save(figure, folder, "engine_square")
