"""Pictures of the comparison with MuJoCo's chain: convergence, errors over time, validity, the square."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import LogNorm
from scipy.ndimage import maximum_filter1d

from scripts.common.plotting import COLOURS, THRESHOLD, save
from scripts.validation.checks import Array, Result
from scripts.validation.engine.models import DEFAULT
from scripts.validation.engine.programmes import PROGRAMMES

TITLES = {programme.name: programme.title for programme in PROGRAMMES}
DRIVERS = {"ifdc": "IFDC, undamped", "flsac": "FLSAC, undamped"}
CREST = 50  # instants of 1 ms
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
    figure, axes = plt.subplots(1, 3, figsize=(15, 5.0))
    for row, colour in zip(rows, COLOURS, strict=False):
        counts = [int(n) for n in row["tip"]]
        axes[0].loglog(counts, [1e3 * row["tip"][str(n)] for n in counts], "o-", color=colour)
        axes[0].plot([], [], "o-", color=colour, label=TITLES[row["programme"]])
    counts = sorted({int(n) for row in rows for n in row["tip"]})
    axes[0].loglog(counts, [100.0 / n**2 for n in counts], color="0.4", linestyle=":", label="second order")
    axes[0].set_xticks(counts, [str(n) for n in counts])
    axes[0].minorticks_off()
    axes[0].set(title="the chain", xlabel="elements a link", ylabel="largest tip error [mm]")
    smallest = min(row["amplitude"] for row in records["errors"])
    for axis, amplitude in zip(axes[1:], (smallest, 1.0), strict=True):
        _by_modes(axis, [row for row in records["errors"] if row["amplitude"] == amplitude])
        bend = 100.0 * max(row["bend"] for row in records["errors"] if row["amplitude"] == amplitude)
        axis.set(title=f"the models, links bent by up to {bend:.2g} %", xlabel="modes a link", xticks=range(1, 5))
    axes[1].set_ylabel("r.m.s. tip error [mm]")
    for name, style in (
        ("linear, cantilever shapes", "-"),
        ("foreshortened", "--"),
        ("foreshortened, polynomials", ":"),
    ):
        axes[2].plot([], [], color="0.3", linestyle=style, label=name)
    axes[0].legend()
    axes[2].legend()
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
    """Tip error over time of some models, the default arm's thicker, a panel for each programme."""
    names = [name for name in TITLES if f"{name} time" in arrays]
    columns = min(3, len(names))
    lines = -(-len(names) // columns)
    figure, axes = plt.subplots(lines, columns, figsize=(5.0 * columns, 1.2 + 3.6 * lines), sharey=True, squeeze=False)
    labels: dict[str, str] = {}
    for name, axis in zip(names, axes.flat, strict=False):
        prefixes = (f"{name} linear", f"{name} foreshortened")
        for key in [key for key in arrays if key.startswith(prefixes)]:
            label = key.removeprefix(f"{name} ")
            colour = labels.setdefault(label, COLOURS[len(labels) % len(COLOURS)])
            width = 2.6 if label == DEFAULT.label else 1.2
            axis.semilogy(arrays[f"{name} time"], _crests(arrays[key]), color=colour, linewidth=width)
        chains = [key for key in arrays if key.startswith(f"{name} chain")]
        finest = max(chains, key=lambda key: int(key.split()[-1]))
        axis.semilogy(arrays[f"{name} time"], _crests(arrays[finest]), color="0.6", linewidth=1.2)
        axis.set(title=TITLES[name], ylim=(1e-3, 2e2))
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    for line in axes:
        line[0].set_ylabel("tip error, largest of 50 ms [mm]")
    for label, colour in labels.items():
        default = label == DEFAULT.label
        text = f"{label} (the default arm)" if default else label
        axes[0, 0].plot([], [], color=colour, linewidth=2.6 if default else 1.2, label=text)
    axes[0, 0].plot([], [], color="0.6", label="the finest chain, before extrapolation")
    figure.legend(loc="outside lower center", ncol=4)
    save(figure, folder, "engine_programmes")


def _crests(error: Array) -> Array:
    """Return the largest value within each 50 ms, in mm, since fast oscillations would fill the picture."""
    return _visible(maximum_filter1d(error, CREST))


def _visible(error: Array) -> Array:
    """In mm; what is exactly zero is not drawn on a logarithmic axis."""
    return np.where(error > 0.0, 1e3 * error, np.nan)


def validity(records: Mapping[str, Any], arrays: dict[str, Array], folder: Path) -> None:
    """Error by deflection in the programmes; and by deflection and spin."""
    maps = [key.removeprefix("map ") for key in arrays if key.startswith(("map linear", "map foreshortened"))]
    figure, axes = plt.subplots(2, max(2, len(maps)), figsize=(17, 9.2))
    for axis, label in zip(axes[0], maps, strict=False):
        for name, colour in zip(TITLES, COLOURS, strict=True):
            rows = [row for row in records["errors"] if (row["programme"], row["model"]) == (name, label)]
            bends, errors = [100.0 * row["bend"] for row in rows], [1e3 * row["rms"] for row in rows]
            axis.loglog(bends, errors, "o-", markersize=4, color=colour, label=TITLES[name] if rows else None)
        axis.axhline(LIMIT, **THRESHOLD)
        axis.set(title=label, xlabel="largest deflection / length [%]", xlim=(0.4, 20.0), ylim=(1e-3, 5e3))
        axis.set_xticks(PERCENT, [f"{x:g}" for x in PERCENT])
        axis.minorticks_off()
    for axis, label in zip(axes[1], maps, strict=False):
        spins = np.broadcast_to(arrays["map spins"][:, None], arrays["map bends"].shape)
        mapped = np.minimum(1e3 * arrays[f"map {label}"], 1e6)
        colours = axis.scatter(
            spins, 100.0 * arrays["map bends"], c=mapped, s=190, marker="s", cmap="viridis", norm=LogNorm(1e-2, 1e3)
        )
        outside = mapped > LIMIT
        axis.plot(spins[outside], 100.0 * arrays["map bends"][outside], "x", color="#D55E00", markersize=7)
        axis.set(title=label, yscale="log", xlabel="spin / first clamped frequency", ylim=(0.2, 25.0))
        axis.set_yticks(PERCENT, [f"{x:g}" for x in PERCENT])
        axis.minorticks_off()
    axes[0, 0].set_ylabel("r.m.s. tip error [mm]")
    axes[1, 0].set_ylabel("largest deflection / length [%]")
    axes[0, 0].legend(fontsize=9)
    figure.colorbar(colours, ax=list(axes[1]), label="r.m.s. tip error [mm]; crosses: above 10 mm", pad=0.01)
    save(figure, folder, "engine_validity")


def on_the_square(records: Mapping[str, Any], arrays: dict[str, Array], folder: Path) -> None:
    """Draw the chain's lap, and every model's distance from it over time."""
    labels = list(dict.fromkeys(row["model"] for row in records["square"] if not row["model"].startswith("chain")))
    colours = {label: plt.get_cmap("tab10")(i) for i, label in enumerate(labels)}
    figure, axes = plt.subplots(2, len(DRIVERS), figsize=(11, 9.0), height_ratios=(1.2, 1.0))
    for (driver, title), (path, error) in zip(DRIVERS.items(), axes.T, strict=True):
        tip = arrays[f"{driver} chain"]
        path.plot(*tip.T, color="0.2", linewidth=1.0)
        path.plot([-6.3, -6.3, 6.3, 6.3, -6.3], [-6.3, 6.3, 6.3, -6.3, -6.3], **THRESHOLD)
        path.set(title=f"{title}: the chain's tip", aspect="equal", xlabel="x [m]", ylabel="y [m]")
        for label in labels:
            away = _crests(arrays[f"{driver} {label}"])
            error.semilogy(1e-3 * np.arange(len(away)), away, color=colours[label], linewidth=0.9)
        error.set(xlabel="time [s]", ylim=(0.1, 2e3))
    axes[1, 0].set_ylabel("the model's tip from the chain's [mm],\nlargest within 50 ms")
    for label in labels:
        axes[1, 0].plot([], [], color=colours[label], label=label)
    figure.legend(loc="outside lower center", ncol=4)
    save(figure, folder, "engine_square")
