"""Pictures of laps of the board: errors over time, paths at the corners, error against changes of the torques."""

import json
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

from flexarm_baselines.optimal.plan import PLANS
from flexarm_env.laps import LAPS
from scripts.common.plotting import BLUE, COLOURS, INK, ORANGE, SOFT, WIDTH, headline, label_ends, running_rms, write
from scripts.docs.arm_pictures import recorded
from scripts.docs.overview_pictures import label_dots
from scripts.docs.replays import ENTRIES

SHOWN = {  # names and colours; others lie below the last line, which is dashed
    "ifdc": ("ifdc", COLOURS[4]),
    "agent square": ("square", ORANGE),
    "agent student_unknown": ("student_unknown", COLOURS[3]),
    "lqg_adaptive": ("lqg_adaptive", BLUE),
    "plan_lqr": ("plan_lqr, which\nreads the true state", SOFT),
}
DASHES = dict.fromkeys(SHOWN, "-") | {"plan_lqr": "--"}
WINDOW = 25  # periods of 10 ms
CORNERS = {
    "start of the swing lap": ("swing", 0.0),
    "start of the plain lap": ("plain", 0.0),
    "first corner of the plain lap": ("plain", 4.0),
    "second corner of the plain lap": ("plain", 8.0),
}
ABOUT = 1.3  # half of what is shown of the plane [m]


def errors(path: Path) -> None:
    """Draw the tip's distance from the target over time, a panel for each lap."""
    figure, axes = plt.subplots(len(LAPS), 1, figsize=(WIDTH, 6.6), sharex=True)
    for axis, lap in zip(axes, LAPS, strict=True):
        ends = []
        for row, (_, colour) in SHOWN.items():
            one = recorded(row, lap)
            away = 1e3 * running_rms(one.away, WINDOW)
            axis.semilogy(one.time, away, color=colour, linewidth=1.6, linestyle=DASHES[row])
            ends.append(away[-1])
        axis.set(title=f"{lap} lap", ylim=(1.0, 3000.0), xlim=(0.0, 16.0), xticks=range(0, 17, 4))
        axis.set_yticks([1, 10, 100, 1000], ["1", "10", "100", "1000"])
        axis.set_ylabel("error, r.m.s. over 0.25 s [mm]")
        label_ends(axis, [*SHOWN.values()], ends)
    axes[-1].set_xlabel("time [s]; the target turns a corner every 4 s")
    headline(figure, "Distance of the true tip from the target")
    write(figure, path)


def corners(path: Path) -> None:
    """Draw the tip's paths within a second of where the target starts or turns."""
    figure, axes = plt.subplots(2, 2, figsize=(WIDTH, 7.6))
    for axis, (title, (lap, time)) in zip(axes.flat, CORNERS.items(), strict=True):
        for row, (name, colour) in SHOWN.items():
            one = recorded(row, lap)
            near = np.abs(one.time - time) <= 1.0
            look = {"color": colour, "linestyle": DASHES[row], "label": name.replace("\n", " ")}
            axis.plot(*one.tip[near].T, linewidth=1.8, **look)
        axis.plot(*one.reference[near].T, color=INK, linestyle=":", label="target")
        x, y = one.reference[one.at(time)] + (0.0, 0.0 if time else 0.8 * ABOUT)
        axis.set(title=title, aspect="equal", xlim=(x - ABOUT, x + ABOUT), ylim=(y - ABOUT, y + ABOUT))
        axis.set(xlabel="x [m]", ylabel="y [m]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    write(figure, path)


def effort(path: Path) -> None:
    """Draw error against changes of the torques, with the best plans known for a range of weights on these."""
    figure, axes = plt.subplots(len(LAPS), 1, figsize=(WIDTH, 7.4), sharex=True)
    dots: dict[str, list[tuple[str, str, float, float]]] = {lap: [] for lap in LAPS}
    lines = {}
    for axis, lap in zip(axes, LAPS, strict=True):
        axis.set_xscale("log")
        axis.set_yscale("log")
        curve = json.loads((PLANS / f"default_{lap}.json").read_text())["pareto"]
        x = [float(np.linalg.norm(one["torque_change_rms"])) for one in curve]
        y = [1e3 * one["true_tip_rms"] for one in curve]
        axis.plot(x, y, color=INK, linewidth=2.0)
        fine = np.geomspace(min(x), max(x), 60)
        lines[lap] = np.column_stack([fine, np.interp(fine, *np.array(sorted(zip(x, y, strict=True))).T)])
        for row in ENTRIES:
            one = recorded(row, lap)
            change = np.linalg.norm(np.sqrt(np.mean(np.diff(one.torque, axis=0) ** 2, axis=0)))
            colour = ORANGE if row.startswith("agent") else BLUE
            error = 1e3 * np.sqrt(np.mean(one.away**2))
            dots[lap].append((row.removeprefix("agent "), colour, float(change), float(error)))
            axis.plot(change, error, "o", color=colour, markersize=8)
        axis.set(title=f"{lap} lap", ylabel="error of the lap, r.m.s. [mm]")
        axis.set(xlim=(1.5, 14.0), ylim=(12.0, 2000.0), yticks=(20, 50, 100, 200, 500, 1000))
        axis.set(xticks=(2, 3, 5, 10))
        for one in (axis.xaxis, axis.yaxis):
            one.set_major_formatter("{x:g}")
            one.minorticks_off()
    axes[-1].set_xlabel("change of the torques from one control period to the next, r.m.s. [N m]")
    headline(figure, "Controllers (blue), trained networks (orange), and the best plans known (line)")
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axis, lap in zip(axes, LAPS, strict=True):
        label_dots(axis, dots[lap], [*lines[lap]])
    write(figure, path)
