"""The paper's figures and ours, drawn from files: PNG for reading, SVG for print."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from flexarm_baselines import paper_system
from flexarm_env import FlexibleArm, Trajectory
from scripts.common.plotting import save
from scripts.paper.cases import SENSINGS

STYLE = {
    "collocated": {"color": "#0072B2", "linestyle": "-", "label": "collocated"},
    "nmp": {"color": "#D55E00", "linestyle": "-", "label": "noncollocated (NMP)"},
    "corrected": {"color": "#111111", "linestyle": (0, (2, 2.5)), "label": "NMP corrected"},
}
REFERENCE = {"color": "0.35", "linestyle": ":", "linewidth": 1.4, "label": "reference"}
CONTROLLER = {"ifdc": "IFDC", "flsac": "FLSAC"}
LINKS = ("#0072B2", "#D55E00")
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
    chosen = {s: runs[f"{controller}_{s}_{place}"] for s in SENSINGS if f"{controller}_{s}_{place}" in runs}
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
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    save(figure, folder, name)


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
    for axis in axes[:2]:
        axis.legend(loc="upper right", ncols=2)
    for axis in axes:
        for switch in np.arange(1, 4) * lap_time / 4:
            axis.axvline(switch, color="0.6", linewidth=0.8, linestyle="--", zorder=0)
    notes = run.notes
    sensor = "end effector" if notes["place"] == "tip" else "0.5 m from the elbow"
    figure.suptitle(f"{CONTROLLER[notes['controller']]}, {STYLE[notes['sensing']]['label']}, sensor: {sensor}")
    save(figure, folder, name)


def rigid_and_true(folder: Path, runs: dict[str, dict[str, Trajectory]]) -> None:
    """What the joints say and where the tip is: error against time, paper's arm and default arm."""
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
    """The bent arm around the first switch, every 0.12 s, under both controllers (default arm, collocated)."""
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
        instants = shown[::120]
        for index, shade in zip(instants, np.linspace(0.85, 0.1, len(instants)), strict=True):
            for link, length in enumerate(run.parameters.link_lengths, 1):
                points = arm.position(run.state[index, : arm.size], link, np.linspace(0.0, length, 40))
                axis.plot(*points.T, color=str(shade), linewidth=1.3, zorder=1)
            axis.plot(*run.tip[index], "o", color="#D55E00", markersize=4)
        axis.plot(0, 0, "ks", markersize=7)
        axis.set_title(CONTROLLER[controller])
        axis.set_aspect("equal")
        axis.set_xlabel("x [m]")
    axes[0].set(ylabel="y [m]", xlim=(-8, 1), ylim=(-1.2, 8))
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    save(figure, folder, "arm_at_corner")


_PANELS = (
    ("overshoot, top left corner [m]", lambda row: row["rigid_overshoot"][0], "tip"),
    ("true tip, r.m.s. error [m]", lambda row: row["true_tip_rms"], "tip"),
    ("vibration, sensor at the tip [m/s]", lambda row: row["vibration"], "tip"),
    ("vibration, sensor near the elbow [m/s]", lambda row: row["vibration"], "elbow"),
)


def sweep_lines(
    folder: Path, rows: Sequence[dict[str, Any]], sweep: str, label: str, base: Sequence[dict[str, Any]]
) -> None:
    """A sweep over a number: four figures of merit against it.

    Args:
        folder: for the files.
        rows: of all sweeps.
        sweep: which one.
        label: of the abscissa.
        base: measures to draw as levels: dicts with "label", "place" and the measures.
    """
    figure, axes = plt.subplots(2, 2, figsize=(12, 7.6), sharex=True)
    for axis, (title, pick, place) in zip(axes.flat, _PANELS, strict=True):
        for sensing in SENSINGS:
            chosen = [r for r in rows if (r["sweep"], r["sensing"], r["place"]) == (sweep, sensing, place)]
            points = [(r["value"], pick(r)) for r in chosen if r["ended"] == "truncated"]
            if points:
                axis.plot(*np.array(points).T, marker="o", markersize=4, **STYLE[sensing])
        for level, dash in zip([b for b in base if b["place"] == place], ("-.", "--", (0, (1, 1))), strict=False):
            axis.axhline(pick(level), color="0.45", linewidth=1, linestyle=dash, label=level["label"])
        _number_axis(axis, [r["value"] for r in rows if r["sweep"] == sweep])
        axis.set_ylabel(title)
        axis.set_ylim(bottom=0)
    for axis in axes[-1]:
        axis.set_xlabel(label)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    save(figure, folder, f"sweep_{sweep}")


def _number_axis(axis: Axes, values: Sequence[float]) -> None:
    """Logarithmic abscissa with a tick, as a plain number, at each value of a sweep."""
    ticks = sorted(set(values))
    axis.set_xscale("log")
    # labels that would run into each other are left out
    shown = [tick for before, tick in zip([0.0, *ticks], ticks, strict=False) if tick > 1.4 * before]
    axis.set_xticks(ticks, [f"{tick:g}" if tick in shown else "" for tick in ticks])
    axis.set_xticks([], minor=True)


def alternatives(folder: Path, rows: Sequence[dict[str, Any]]) -> None:
    """The law's alternative readings: overshoot, or when the run ended."""
    chosen = [r for r in rows if r["sweep"] in ("alternatives", "current_jacobian", "elbow_branch")]
    names = list(dict.fromkeys(r["value"] for r in chosen))
    figure, axis = plt.subplots(figsize=(11, 0.75 * len(names) + 1.6))
    for offset, controller in ((0.18, "ifdc"), (-0.18, "flsac")):
        for y, name in enumerate(reversed(names)):
            for row in (r for r in chosen if r["value"] == name and r["controller"] == controller):
                whole = row["ended"] == "truncated"
                value = row["rigid_overshoot"][0] if whole else 0.0
                axis.barh(y + offset, value, height=0.34, color=LINKS[controller == "flsac"])
                text = f"{value:.2f} m" if whole else f"unstable: stopped at {row['duration']:.2f} s ({row['ended']})"
                axis.annotate(
                    f" {CONTROLLER[controller]} {text}", (max(value, 0.0), y + offset), va="center", fontsize=9
                )
    axis.set_yticks(range(len(names)), list(reversed(names)))
    axis.set(xlabel="overshoot past the top left corner, NMP case, sensor at the end effector [m]", xlim=(0, 1.4))
    save(figure, folder, "alternatives")


def true_tip_feedback(folder: Path, rows: Sequence[dict[str, Any]]) -> None:
    """The same law fed with the true tip: error where it stays bounded, time of failure where not."""
    figure, axes = plt.subplots(2, 2, figsize=(12, 7), sharex=True)
    for row, (sweep, text) in zip(
        axes, (("true_tip_feedback", "not delayed"), ("late_true_tip_feedback", "31.2 ms late")), strict=True
    ):
        _true_tip_row(row, [r for r in rows if r["sweep"] == sweep])
        for axis in row:
            axis.set_title(f"true tip fed back, {text}")
    for axis in axes[-1]:
        axis.set_xlabel("constant gain $\\lambda$")
    save(figure, folder, "true_tip_feedback")


def _true_tip_row(axes: Sequence[Axes], chosen: Sequence[dict[str, Any]]) -> None:
    for color, arm in zip(("#111111", *LINKS), dict.fromkeys(r["arm"] for r in chosen), strict=False):
        mine = [r for r in chosen if r["arm"] == arm]
        label = "damping ratio " + arm.removeprefix("zeta ")
        axes[0].plot([r["value"] for r in mine], [r["duration"] for r in mine], "o-", color=color, label=label)
        whole = [r for r in mine if r["ended"] == "truncated"]
        axes[1].plot([r["value"] for r in whole], [r["true_tip_rms"] for r in whole], "o-", color=color, label=label)
    axes[0].set(ylabel="run lasts [s]", ylim=(0, None))
    axes[1].set_ylabel("true tip, r.m.s. error of whole laps [m]")
    axes[1].set_ylim(bottom=0)
    for axis in axes:
        _number_axis(axis, [r["value"] for r in chosen])
        axis.legend()
