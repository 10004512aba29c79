"""Pictures of the comparison with MuJoCo's chain: convergence, errors over time, validity."""

from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from scripts.common.plotting import BLUE, COLOURS, GREEN, ORANGE, SOFT, THRESHOLD, WIDTH, headline, running_rms
from tests.validation.engine.study import AMPLITUDES, FINEST, KICKS, NAMES, SMALLEST, SPINS, case, spinning
from tests.validation.motion import DEFAULT, HELD, MODELS, PROGRAMMES, Array, Model

TITLES = {programme.name: programme.title for programme in PROGRAMMES}
WINDOW = 100  # instants of 1 ms
LINES = {  # the models that are drawn over time
    Model("linear", 2): ("linear arm: 2 modes", ORANGE),
    Model("foreshortened", 3): ("links keep their length, 3 modes", GREEN),
    DEFAULT: ("default arm: 3 polynomials", BLUE),
    Model("foreshortened", 4, "polynomial"): ("4 polynomials", COLOURS[5]),
}
KINDS = (("linear", "cantilever", "-"), ("foreshortened", "cantilever", "--"), ("foreshortened", "polynomial", ":"))
PERCENT = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
LIMIT = 10.0  # [mm], drawn as the threshold


def smoothed(error: Array) -> Array:
    """Return the r.m.s. over a tenth of a second in mm; what is exactly zero is not drawn."""
    size = 1e3 * running_rms(error, WINDOW)
    return np.where(size > 0.0, size, np.nan)


def convergence() -> tuple[Figure, str]:
    """Draw the tip error of chains by elements; of models by modes, at the smallest and at full amplitude."""
    figure, axes = plt.subplots(1, 3, figsize=(WIDTH, 5.6))
    counts = [*case(NAMES[0]).chains]
    for name, colour in zip(NAMES, COLOURS, strict=False):
        errors = [1e3 * case(name).chain_error(n).max() for n in counts]
        axes[0].loglog(counts, errors, "o-", markersize=4, color=colour, label=TITLES[name])
    axes[0].loglog(counts, [100.0 / n**2 for n in counts], **THRESHOLD, label="second order")
    axes[0].set_xticks(counts, [str(n) for n in counts])
    axes[0].minorticks_off()
    axes[0].set(title="the chain's own error", xlabel="elements a link", ylabel="tip error [mm]")
    for axis, amplitude in zip(axes[1:], (SMALLEST, 1.0), strict=True):
        for name, colour in zip(NAMES, COLOURS, strict=False):
            for kinematics, shapes, style in KINDS:
                own = [m for m in MODELS if (m.kinematics, m.mode_shapes) == (kinematics, shapes)]
                errors = [1e3 * case(name, amplitude).rms(m) for m in own]
                modes = [m.modes_per_link for m in own]
                axis.semilogy(modes, errors, marker="o", markersize=4, linestyle=style, color=colour)
        bend = 100.0 * max(case(name, amplitude).reference.bend for name in NAMES)
        axis.set(title=f"models, bent by {bend:.2g} %", xlabel="shapes a link", xticks=range(1, 5), ylim=(1e-4, 100.0))
    for name, style in (("linear arm, modes", "-"), ("links keep length, modes", "--"), ("the same, polynomials", ":")):
        axes[2].plot([], [], color=SOFT, linestyle=style, label=name)
    handles = [pair for axis in (axes[0], axes[2]) for pair in zip(*axis.get_legend_handles_labels(), strict=True)]
    figure.legend(*zip(*handles, strict=True), loc="outside lower left", ncols=3)
    headline(figure, "Tip errors of the chain (largest) and of models against it (r.m.s.)")
    return figure, "engine_convergence"


def programmes() -> tuple[Figure, str]:
    """Draw the tip error over time of some models, a panel for each programme."""
    figure, axes = plt.subplots(3, 2, figsize=(WIDTH, 8.3), sharey=True)
    for name, axis in zip(NAMES, axes.flat, strict=True):
        found = case(name)
        time = HELD * np.arange(len(found.reference.tip))
        for model, (label, colour) in LINES.items():
            axis.semilogy(time, smoothed(found.tip(model)), color=colour, linewidth=1.8, label=label)
        label = f"the chain of {FINEST[1]} elements, against its limit"
        axis.semilogy(time, smoothed(found.chain_error(FINEST[1])), color=SOFT, linestyle=":", label=label)
        axis.set(title=TITLES[name], ylim=(1e-3, 2e2))
        axis.set_yticks([0.001, 0.01, 0.1, 1, 10, 100], ["0.001", "0.01", "0.1", "1", "10", "100"])
        axis.set_yticks([], minor=True)
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    for line in axes:
        line[0].set_ylabel("tip error [mm]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=2)
    headline(figure, "Distance of each model's tip from the MuJoCo chain's, r.m.s. over 0.1 s")
    return figure, "engine_programmes"


def validity() -> tuple[Figure, str]:
    """Draw the error by deflection in the programmes; and by deflection and spin."""
    figure, axes = plt.subplots(2, 2, figsize=(WIDTH, 8.4), sharey="row", sharex="row")
    linear = Model("linear", 2)
    for axis, model in zip(axes[0], (linear, DEFAULT), strict=True):
        for name, colour in zip(NAMES, COLOURS, strict=True):
            found = [case(name, amplitude) for amplitude in AMPLITUDES]
            bends, errors = [100.0 * one.reference.bend for one in found], [1e3 * one.rms(model) for one in found]
            axis.loglog(bends, errors, "o-", markersize=4, color=colour, label=TITLES[name])
        axis.axhline(LIMIT, **THRESHOLD)
        axis.set(title=LINES[model][0], xlabel="largest deflection / length [%]", xlim=(0.4, 20.0), ylim=(1e-3, 5e3))
        _percent(axis.xaxis)
    for axis, model in zip(axes[1], (linear, Model("foreshortened", 3)), strict=True):
        for spin in SPINS:
            for found in (spinning(spin, kick) for kick in KICKS):
                good = 1e3 * found.rms(model) <= LIMIT
                look: dict[str, Any] = {"marker": "o" if good else "x", "color": BLUE if good else ORANGE}
                axis.plot(spin, 100.0 * found.reference.bend, markersize=7, **look)
        axis.set(title=LINES[model][0], yscale="log", xlabel="spin / first clamped frequency [1]", ylim=(0.2, 25.0))
        _percent(axis.yaxis)
    axes[0, 0].set_ylabel("r.m.s. tip error [mm]")
    axes[1, 0].set_ylabel("largest deflection / length [%]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    headline(
        figure,
        "Where models are valid. Above: error by deflection, dotted line at 10 mm.\n"
        "Below: a spinning, vibrating arm; dots: below 10 mm, crosses: above",
    )
    return figure, "engine_validity"


def _percent(axis: Any) -> None:
    axis.set_ticks(PERCENT, [f"{x:g}" for x in PERCENT])
    axis.set_ticks([], minor=True)
