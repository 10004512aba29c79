"""The paper's figures and ours, drawn from files: PNG for reading, SVG for print."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from flexarm_baselines import paper_system
from flexarm_env import FlexibleArm, Trajectory
from flexarm_env.metrics import elbow_changes
from scripts.common.plotting import save
from scripts.paper.cases import SENSINGS

Array = NDArray[np.float64]
STYLE: dict[str, dict[str, Any]] = {
    "collocated": {"color": "#0072B2", "linestyle": "-", "label": "collocated"},
    "nmp": {"color": "#D55E00", "linestyle": "-", "label": "noncollocated (NMP)"},
    "corrected": {"color": "#111111", "linestyle": (0, (2, 2.5)), "label": "NMP corrected"},
}
REFERENCE: dict[str, Any] = {"color": "0.35", "linestyle": ":", "linewidth": 1.4, "label": "reference"}
CONTROLLER = {"ifdc": "IFDC", "flsac": "FLSAC"}
LINKS = ("#0072B2", "#D55E00")
CHANGE: dict[str, Any] = {"color": "#CC79A7", "linewidth": 1.6, "label": "elbow changes sides"}
THIN = 5  # every fifth ms is drawn: more points than an A4 page has dots


def fuzzy_sets(folder: Path) -> None:
    """Figure 2: input and output membership functions."""
    system = paper_system()
    figure, axes = plt.subplots(1, 2, figsize=(11, 3.6))
    panels = (
        (axes[0], system.inputs[0], "(a) input $\\delta_1$, $\\delta_2$", ("N", "ZERO", "P")),
        (axes[1], system.output, "(b) output $\\lambda$", ("ZERO", "PM", "PMAX")),
    )
    for axis, variable, title, names in panels:
        x = np.linspace(*variable.universe, 1001)
        for triangle, name in zip(variable.sets, names, strict=True):
            axis.plot(x, triangle.membership(x), linewidth=2)
            axis.annotate(name, (triangle.peak, 1.03), ha="center")
        axis.set(title=title, ylabel="membership", ylim=(0, 1.15), xlim=variable.universe)
    axes[0].set_xlabel("$\\delta$ = tip deflection / 0.2 m, times $K_n$")
    axes[1].set_xlabel("gain $\\lambda$")
    save(figure, folder, "fig2")


def paths(
    folder: Path, name: str, runs: dict[str, Trajectory], controller: str, place: str, zoom: float | None, title: str
) -> None:
    """Figures 5 to 7: the three sensings superposed; left the paper's tip, right the true one.

    Args:
        folder: for the files.
        name: of the figure.
        runs: of one column, by case name.
        controller: "ifdc" or "flsac".
        place: "tip" or "elbow".
        zoom: half width of the view around the first direction switch [m]; None for the whole square.
        title: of the figure.
    """
    chosen: dict[str, Trajectory] = {
        s: runs[f"{controller}_{s}_{place}"] for s in SENSINGS if f"{controller}_{s}_{place}" in runs
    }
    if not chosen:
        return
    figure, axes = plt.subplots(1, 2, figsize=(12.5, 6.4), sharex=True, sharey=True)
    for axis, tip in zip(axes, ("rigid", "true"), strict=True):
        reference = next(iter(chosen.values())).reference
        assert reference is not None
        axis.plot(*reference.T, **REFERENCE)
        for sensing, run in chosen.items():
            path = run.rigid_tip if tip == "rigid" else run.tip
            axis.plot(*path[::THIN].T, linewidth=1.5, **STYLE[sensing])
        if place == "tip":  # with the other sensor the stretched arm swings through the straight pose all the time
            _mark_changes(axis, chosen, tip, zoom)
        if zoom is not None:
            _show_direction(axis, reference, chosen, tip)
        axis.set_aspect("equal")
        axis.set_xlabel("x [m]")
        if place == "elbow":
            _inset_of_the_start(axis, chosen, tip)
    axes[0].set(ylabel="y [m]", title="end effector by rigid kinematics, as in the paper")
    axes[1].set_title("true end effector, with deflection")
    if zoom is None:
        axes[0].set(xlim=(-9.6, 9.6), ylim=(-9.6, 9.6))
    else:
        axes[0].set(xlim=(-6.3 - zoom, -6.3 + zoom), ylim=(6.3 - zoom, 6.3 + zoom))
    figure.suptitle(title)
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    save(figure, folder, name)


def _mark_changes(axis: Axes, runs: dict[str, Trajectory], tip: str, zoom: float | None) -> None:
    """Where the tip is when the elbow changes sides; on the whole square with the time of the first run to do so."""
    labelled: list[float] = []
    for sensing, run in runs.items():
        path = run.rigid_tip if tip == "rigid" else run.tip
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
    """Arrows along the reference, and when the runs that differ pass: dots every quarter of a second."""
    switch = reference[len(reference) // 4]
    for start, end in ((-0.5, -0.3), (0.3, 0.5)):  # share of the view's half width before and behind the corner
        ends = [switch + 2.0 * np.array([share, 0.0] if share > 0.0 else [0.0, share]) for share in (start, end)]
        axis.annotate("", ends[1], ends[0], arrowprops={"arrowstyle": "-|>", "color": "0.35", "mutation_scale": 18})
    for sensing, run in runs.items():
        if sensing == "corrected" and "nmp" in runs:
            continue  # lies on top of NMP's
        path = run.rigid_tip if tip == "rigid" else run.tip
        quarters = np.arange(3.5, 5.51, 0.25) / 16.0 * run.time[-1]
        for number, time in enumerate(quarters):
            at = path[np.argmin(np.abs(run.time - time))]
            axis.plot(*at, "o", color=STYLE[sensing]["color"], markersize=5, zorder=4)
            if number % 2 == 0:
                offset = (-34, 3) if sensing == "nmp" else (7, -10)
                axis.annotate(
                    f"{time:.1f} s", at, offset, textcoords="offset points", fontsize=9, color=STYLE[sensing]["color"]
                )


def _inset_of_the_start(axis: Axes, runs: dict[str, Trajectory], tip: str) -> None:
    """Where the circle begins, larger, in the empty middle of the square."""
    inset = axis.inset_axes((0.33, 0.22, 0.34, 0.56))
    for sensing, run in runs.items():
        path = run.rigid_tip if tip == "rigid" else run.tip
        inset.plot(*path[:4000].T, linewidth=1.1, **STYLE[sensing])
    inset.set(xlim=(-9.3, -6.0), ylim=(-6.9, -1.5), xticks=[], yticks=[])
    inset.set_aspect("equal")
    inset.set_title("first 4 s", fontsize=9)
    axis.indicate_inset_zoom(inset, edgecolor="0.5")


PATH_FIGURES: dict[str, tuple[str, str, float | None, str]] = {
    "fig5a": ("ifdc", "tip", None, "Fig. 5 (a)  IFDC, sensor at the end effector"),
    "fig5b": ("flsac", "tip", None, "Fig. 5 (b)  FLSAC, sensor at the end effector"),
    "fig6a": ("ifdc", "tip", 2.0, "Fig. 6 (a)  IFDC, first direction switch"),
    "fig6b": ("flsac", "tip", 2.0, "Fig. 6 (b)  FLSAC, first direction switch"),
    "fig7a": ("ifdc", "elbow", None, "Fig. 7 (a)  IFDC, sensor 0.5 m from the elbow"),
    "fig7b": ("flsac", "elbow", None, "Fig. 7 (b)  FLSAC, sensor 0.5 m from the elbow"),
}


def time_histories(folder: Path, name: str, run: Trajectory, lap_time: float) -> None:
    """Deflection, torque and lambda of one run against time."""
    assert run.gain is not None
    figure, axes = plt.subplots(3, 1, figsize=(10, 7.2), sharex=True)
    time = run.time[::THIN]
    for joint, link in enumerate(("link 1", "link 2")):
        axes[0].plot(time, run.tip_deflection[::THIN, joint], color=LINKS[joint], label=link)
        axes[1].plot(time, run.torque[::THIN, joint], color=LINKS[joint], label=("shoulder", "elbow")[joint])
    axes[2].plot(time, run.gain[::THIN], color="#111111")
    axes[0].set_ylabel("tip deflection [m]")
    axes[1].set_ylabel("torque [N m]")
    axes[2].set(ylabel="gain $\\lambda$", xlabel="time [s]", xlim=(0, run.time[-1]))
    axes[2].set_ylim(bottom=0)
    for axis in axes:
        for switch in np.arange(1, 4) * lap_time / 4:
            axis.axvline(switch, color="0.6", linewidth=0.8, linestyle="--", zorder=0)
    notes = run.notes
    if notes["place"] == "tip":
        _change_lines(axes[:2], run)
    for axis in axes[:2]:
        axis.legend(loc="upper right", ncols=3)
    sensor = "end effector" if notes["place"] == "tip" else "0.5 m from the elbow"
    figure.suptitle(f"{CONTROLLER[notes['controller']]}, {STYLE[notes['sensing']]['label']}, sensor: {sensor}")
    save(figure, folder, name)


def _change_lines(axes: Sequence[Axes], run: Trajectory) -> None:
    """Draw a line at each instant at which the elbow changes sides; one label an axis."""
    for axis in axes:
        for number, change in enumerate(elbow_changes(run)):
            style = CHANGE if number == 0 else CHANGE | {"label": None}
            axis.axvline(change, zorder=0, **style)


def rigid_and_true(folder: Path, runs: dict[str, dict[str, Trajectory]]) -> None:
    """Draw error against time by the joints and at the tip, for the paper's arm and the default arm."""
    columns = [name for name in ("paper", "default") if name in runs]
    figure, axes = plt.subplots(
        len(columns), 2, figsize=(12, 3.4 * len(columns)), sharex=True, sharey=True, squeeze=False
    )
    for row, column in zip(axes, columns, strict=True):
        for axis, controller in zip(row, CONTROLLER, strict=True):
            run = runs[column].get(f"{controller}_collocated_tip")
            if run is None or run.reference is None:
                continue
            for path, color, label in (
                (run.rigid_tip, LINKS[0], "rigid-kinematics tip"),
                (run.tip, LINKS[1], "true tip"),
            ):
                error = np.linalg.norm(path - run.reference, axis=1)
                rms = float(np.sqrt(np.mean(error**2)))
                axis.plot(run.time[::THIN], error[::THIN], color=color, label=f"{label}, r.m.s. {rms:.2f} m")
            _change_lines([axis], run)
            arm = "paper's arm" if column == "paper" else "default arm"
            axis.set_title(f"{CONTROLLER[controller]}, collocated, {arm}")
            axis.legend(loc="upper left")
    for axis in axes[:, 0]:
        axis.set_ylabel("distance from reference [m]")
    for axis in axes[-1]:
        axis.set_xlabel("time [s]")
    axes[0, 0].set_ylim(0, 1.35 * axes[0, 0].get_ylim()[1])  # room for the legends
    save(figure, folder, "rigid_and_true_tip")


def arm_at_corner(folder: Path, runs: dict[str, dict[str, Trajectory]], lap_time: float) -> None:
    """Draw the bent arm around the first switch, every 0.12 s, under both controllers (default arm, collocated)."""
    figure, axes = plt.subplots(1, 2, figsize=(12.5, 6.2), sharex=True, sharey=True)
    for axis, controller in zip(axes, CONTROLLER, strict=True):
        run = runs.get("default", {}).get(f"{controller}_collocated_tip")
        if run is None or run.reference is None:
            plt.close(figure)
            return
        arm = FlexibleArm(run.parameters)
        axis.plot(*run.reference.T, **REFERENCE)
        switch = lap_time / 4
        shown = np.flatnonzero((run.time > switch - 0.5) & (run.time < switch + 1.4))
        axis.plot(*run.tip[shown].T, color="#D55E00", linewidth=2, label="true tip")
        axis.plot(*run.rigid_tip[shown].T, color="#0072B2", linewidth=1.5, label="tip by rigid kinematics")
        changes = [t for t in elbow_changes(run) if run.time[shown[0]] <= t <= run.time[shown[-1]]]
        at = run.tip[[int(np.argmin(np.abs(run.time - t))) for t in changes]]
        axis.plot(*at.T, "D", color=CHANGE["color"], mec="k", markersize=8, zorder=5, label=CHANGE["label"])
        instants = shown[::120]
        for index, shade in zip(instants, np.linspace(0.85, 0.1, len(instants)), strict=True):
            for link, length in enumerate(run.parameters.link_lengths, 1):
                points = arm.position(run.state[index, : arm.size], link, np.linspace(0.0, length, 40))
                axis.plot(*points.T, color=str(shade), linewidth=1.3, zorder=1)
            axis.plot(*run.tip[index], "o", color="#D55E00", markersize=4)
        axis.plot(0, 0, "ks", markersize=7)
        when = ", ".join(f"{t:.2f}" for t in changes)
        axis.set_title(CONTROLLER[controller] + (f": elbow changes sides at {when} s" if changes else ""))
        axis.set_aspect("equal")
        axis.set_xlabel("x [m]")
    axes[0].set(ylabel="y [m]", xlim=(-8, 1), ylim=(-1.2, 8))
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    save(figure, folder, "arm_at_corner")
