"""The paper's figures, and ours."""

from collections.abc import Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexarm_baselines import paper_system
from flexarm_env import Trajectory
from flexarm_env.metrics import elbow_changes
from scripts.common.plotting import BLUE, COLOURS, GREEN, INK, ORANGE, SOFT, WIDTH, headline
from scripts.paper.cases import SENSINGS

Array = NDArray[np.float64]
STYLE: dict[str, dict[str, Any]] = {
    "collocated": {"color": BLUE, "linestyle": "-", "label": "collocated"},
    "nmp": {"color": ORANGE, "linestyle": "-", "label": "noncollocated"},
    "corrected": {"color": INK, "linestyle": (0, (2, 2.5)), "label": "noncollocated, corrected"},
}
OVERLAID = {"tip": " (on the same path)", "elbow": " (all three nearly coincide)"}  # the dashed line, by place
REFERENCE: dict[str, Any] = {"color": SOFT, "linestyle": ":", "linewidth": 1.4, "label": "reference"}
CONTROLLER = {"ifdc": "IFDC", "flsac": "FLSAC"}
LINKS = (BLUE, ORANGE)
CHANGE: dict[str, Any] = {"color": COLOURS[3], "linewidth": 1.6, "label": "elbow changes sides"}
THIN = 5  # every fifth ms is drawn: more points than an A4 page has dots


def fuzzy_sets() -> Figure:
    """Draw figure 2: input and output membership functions."""
    system = paper_system()
    figure, axes = plt.subplots(1, 2, figsize=(WIDTH, 3.0), sharey=True)
    panels = (
        (axes[0], system.inputs[0], "(a) input: a link's deflection", ("N", "ZERO", "P")),
        (axes[1], system.output, "(b) output: the gain", ("ZERO", "PM", "PMAX")),
    )
    for axis, variable, title, names in panels:
        x = np.linspace(*variable.universe, 1001)
        sides = ("left", "center", "right")
        for triangle, name, colour, side in zip(variable.sets, names, (BLUE, ORANGE, GREEN), sides, strict=True):
            axis.plot(x, triangle.membership(x), color=colour, linewidth=2)
            axis.text(triangle.peak, 1.04, name, color=colour, ha=side)
        axis.set(title=title, ylim=(0, 1.2), xlim=variable.universe)
    axes[0].set(xlabel="$\\delta$: tip deflection / 0.2 m, times $K_n$ [1]", ylabel="membership [1]")
    axes[1].set_xlabel("gain $\\lambda$ [1]")
    return figure


def paths(runs: dict[str, Trajectory], controller: str, place: str, zoom: float | None, title: str) -> Figure:
    """Draw figures 5 to 7: the three sensings superposed; left the paper's tip, right the true one.

    At least one run must be of this controller and place. `zoom` is half the width of the view around the first
    direction switch [m]; None: the whole square.
    """
    chosen: dict[str, Trajectory] = {s: run for s in SENSINGS if (run := runs.get(f"{controller}_{s}_{place}"))}
    figure, axes = plt.subplots(1, 2, figsize=(WIDTH, 5.0), sharex=True, sharey=True)
    for axis, tip in zip(axes, ("rigid_tip", "tip"), strict=True):
        reference = next(iter(chosen.values())).reference
        assert reference is not None
        axis.plot(*reference.T, **REFERENCE)
        for sensing, run in chosen.items():
            (line,) = axis.plot(*getattr(run, tip)[::THIN].T, linewidth=1.5, **STYLE[sensing])
            if sensing == "corrected" and len(chosen) == len(SENSINGS):
                line.set_label(f"{line.get_label()}{OVERLAID[place]}")
        if place == "tip":  # with the other sensor the stretched arm swings through the straight pose all the time
            _mark_changes(axis, chosen, tip, zoom)
        if zoom is not None:
            _show_direction(axis, reference, chosen, tip)
        axis.set_aspect("equal")
        axis.set_xlabel("x [m]")
        if place == "elbow":
            _inset_of_the_start(axis, chosen, tip)
    axes[0].set(ylabel="y [m]", title="rigid tip, as the paper plots it")
    axes[1].set_title("true tip")
    if zoom is None:
        axes[0].set(xlim=(-9.6, 9.6), ylim=(-9.6, 9.6))
    else:
        axes[0].set(xlim=(-6.3 - zoom, -6.3 + zoom), ylim=(6.3 - zoom, 6.3 + zoom))
    headline(figure, title)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower left", ncols=2)
    return figure


def _mark_changes(axis: Axes, runs: dict[str, Trajectory], tip: str, zoom: float | None) -> None:
    """Mark the tip when the elbow changes sides; on the whole square with the time of the first run to do so."""
    labelled: list[float] = []
    for sensing, run in runs.items():
        path = getattr(run, tip)
        for change in elbow_changes(run):
            at = path[np.argmin(np.abs(run.time - change))]
            if zoom is not None and np.abs(at - [-6.3, 6.3]).max() > zoom:
                continue
            label = None if labelled else CHANGE["label"]
            style = {"color": CHANGE["color"], "mec": STYLE[sensing]["color"], "mew": 1.3, "markersize": 7}
            axis.plot(*at, "D", linestyle="none", label=label, zorder=5, **style)
            if zoom is None and all(abs(change - other) > 0.5 for other in labelled):
                outwards = np.array([26.0, 12.0]) * np.sign(at)  # points
                axis.annotate(f"{change:.1f} s", at, outwards, textcoords="offset points", ha="center", va="center")
            labelled.append(float(change))


def _show_direction(axis: Axes, reference: Array, runs: dict[str, Trajectory], tip: str) -> None:
    """Draw arrows along the reference, and dots every quarter of a second on the runs that differ."""
    switch = reference[len(reference) // 4]
    for start, end in ((-0.5, -0.3), (0.3, 0.5)):  # share of the view's half width before and behind the corner
        ends = [switch + 2.0 * np.array([share, 0.0] if share > 0.0 else [0.0, share]) for share in (start, end)]
        axis.annotate("", ends[1], ends[0], arrowprops={"arrowstyle": "-|>", "color": "0.35", "mutation_scale": 18})
    for sensing, run in runs.items():
        if sensing == "corrected" and "nmp" in runs:
            continue  # lies on top of NMP's
        path, quarters = getattr(run, tip), np.arange(3.5, 5.51, 0.25) / 16.0 * run.time[-1]
        for number, time in enumerate(quarters):
            at = path[np.argmin(np.abs(run.time - time))]
            axis.plot(*at, "o", color=STYLE[sensing]["color"], markersize=5, zorder=4)
            if number % 4 == 2:
                offset = (-34, 6) if sensing == "nmp" else (8, -16)
                axis.annotate(f"{time:.1f} s", at, offset, textcoords="offset points", color=STYLE[sensing]["color"])


def _inset_of_the_start(axis: Axes, runs: dict[str, Trajectory], tip: str) -> None:
    """Draw the start of the circle larger, in the empty middle of the square."""
    inset = axis.inset_axes((0.36, 0.25, 0.34, 0.5))
    for sensing, run in runs.items():
        inset.plot(*getattr(run, tip)[:4000].T, linewidth=1.1, **STYLE[sensing])
    inset.set(xlim=(-9.3, -6.0), ylim=(-6.9, -1.5), xticks=(-9, -7), yticks=(-6, -4, -2), title="first 4 s [m]")
    inset.set_aspect("equal")
    axis.indicate_inset_zoom(inset, edgecolor=SOFT)


PATH_FIGURES: dict[str, tuple[str, str, float | None, str]] = {
    "fig5a": ("ifdc", "tip", None, "Fig. 5 (a)  IFDC, sensor at the tip"),
    "fig5b": ("flsac", "tip", None, "Fig. 5 (b)  FLSAC, sensor at the tip"),
    "fig6a": ("ifdc", "tip", 2.0, "Fig. 6 (a)  IFDC, first corner; a dot every 0.25 s"),
    "fig6b": ("flsac", "tip", 2.0, "Fig. 6 (b)  FLSAC, first corner; a dot every 0.25 s"),
    "fig7a": ("ifdc", "elbow", None, "Fig. 7 (a)  IFDC, sensor 0.5 m from the elbow"),
    "fig7b": ("flsac", "elbow", None, "Fig. 7 (b)  FLSAC, sensor 0.5 m from the elbow"),
}


def time_histories(run: Trajectory, lap_time: float) -> Figure:
    """Draw deflection, torque and lambda of one run against time."""
    assert run.gain is not None
    figure, axes = plt.subplots(3, 1, figsize=(WIDTH, 6.4), sharex=True)
    time = run.time[::THIN]
    for joint, link in enumerate(("link 1", "link 2")):
        axes[0].plot(time, run.tip_deflection[::THIN, joint], color=LINKS[joint], label=link)
        axes[1].plot(time, run.torque[::THIN, joint], color=LINKS[joint], label=("shoulder", "elbow")[joint])
    axes[2].plot(time, run.gain[::THIN], color=INK)
    axes[0].set_ylabel("tip deflection [m]")
    axes[1].set_ylabel("torque [N m]")
    axes[2].set(ylabel="gain $\\lambda$ [1]", xlabel="time [s]", xlim=(0, run.time[-1]))
    axes[2].set_ylim(bottom=0)
    for axis in axes:
        for switch in np.arange(1, 4) * lap_time / 4:
            axis.axvline(switch, color="0.6", linewidth=0.8, linestyle="--", zorder=0)
    notes = run.notes
    if notes["place"] == "tip":
        _change_lines(axes[:2], run)
    for axis in axes[:2]:
        axis.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=3)
    sensor = "at the tip" if notes["place"] == "tip" else "0.5 m from the elbow"
    headline(figure, f"{CONTROLLER[notes['controller']]}, {STYLE[notes['sensing']]['label']}, sensor {sensor}")
    return figure


def _change_lines(axes: Sequence[Axes], run: Trajectory) -> None:
    """Draw a line at each instant at which the elbow changes sides; one label an axis."""
    for axis in axes:
        for number, change in enumerate(elbow_changes(run)):
            style = CHANGE if number == 0 else CHANGE | {"label": None}
            axis.axvline(change, zorder=0, **style)


def rigid_and_true(runs: dict[str, dict[str, Trajectory]]) -> Figure:
    """Draw error against time by the joints and at the tip, for the paper's arm and the linear arm."""
    columns = [name for name in ("paper", "linear") if name in runs]
    size = (WIDTH, 0.9 + 2.6 * len(columns))
    figure, axes = plt.subplots(len(columns), 2, figsize=size, sharex=True, sharey=True, squeeze=False)
    for row, column in zip(axes, columns, strict=True):
        for axis, controller in zip(row, CONTROLLER, strict=True):
            run = runs[column].get(f"{controller}_collocated_tip")
            if run is None or run.reference is None:
                continue
            found = []
            for path, color, label in ((run.tip, ORANGE, "true tip"), (run.rigid_tip, BLUE, "rigid tip")):
                error = np.linalg.norm(path - run.reference, axis=1)
                found.append(f"{label} {np.sqrt(np.mean(error**2)):.2f} m")
                axis.plot(run.time[::THIN], error[::THIN], color=color, label=label)
            _change_lines([axis], run)
            arm = "paper's arm" if column == "paper" else "linear arm"
            axis.set_title(f"{CONTROLLER[controller]}, {arm}; r.m.s.:\n{', '.join(found)}")
    for axis in axes[:, 0]:
        axis.set_ylabel("distance [m]")
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    axes[0, 0].set_ylim(bottom=0)
    headline(figure, "Distance of the tip from the reference: what the paper's law sees, and the truth")
    handles = {label: line for axis in axes.flat for line, label in zip(*axis.get_legend_handles_labels(), strict=True)}
    figure.legend(handles.values(), handles.keys(), loc="outside lower left", ncols=3)
    return figure
