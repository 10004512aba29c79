"""Figures of the sweeps."""

from collections.abc import Callable, Sequence
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from scripts.common.plotting import BLUE, INK, ORANGE, SOFT, WIDTH, headline, number_ticks
from scripts.paper.cases import SENSINGS
from scripts.paper.figures import CONTROLLER, LINKS, STYLE

Rows = Sequence[dict[str, Any]]
TIP_SWEEPS = ("true_tip_feedback", "late_true_tip_feedback")
TIP_COLORS = {"zeta 0": INK, "zeta 0.01": BLUE, "zeta 0.03": ORANGE}
READINGS = {
    "adopted reading": "as reproduced here",
    "rates through the current Jacobian": "rates through the\ncurrent Jacobian",
    "elbow bent the other way at the start (theta2 < 0)": "elbow on the other\nside at the start",
    "rates delayed too, by 1.2 ms only": "rates late, too,\nby 1.2 ms only",
    "rates delayed too": "rates late, too",
    "command delayed per joint": "command late\nfor each joint",
}
_PANELS: tuple[tuple[str, Callable[[dict[str, Any]], float], str], ...] = (
    ("overshoot at the top left corner [m]", lambda row: row["rigid_overshoot"][0], "tip"),
    ("r.m.s. error of the true tip [m]", lambda row: row["true_tip_rms"], "tip"),
    ("vibration, sensor at the tip [m/s]", lambda row: row["vibration"], "tip"),
    ("vibration, sensor at the elbow [m/s]", lambda row: row["vibration"], "elbow"),
)


def sweep_lines(rows: Rows, sweep: str, label: str, base: Rows) -> Figure:
    """Draw a sweep over a number: four figures of merit against it."""
    figure, axes = plt.subplots(2, 2, figsize=(WIDTH, 6.8), sharex=True)
    for axis, (title, pick, place) in zip(axes.flat, _PANELS, strict=True):
        for sensing in SENSINGS:
            chosen = [r for r in rows if (r["sweep"], r["sensing"], r["place"]) == (sweep, sensing, place)]
            points = [(r["value"], pick(r)) for r in chosen if not r["ended_early"]]
            if points:
                axis.plot(*np.array(points).T, marker="o", markersize=4, **STYLE[sensing])
        for level, dash in zip([b for b in base if b["place"] == place], ("-.", "--", (0, (1, 1))), strict=False):
            axis.axhline(pick(level), color=SOFT, linewidth=1.4, linestyle=dash, label=level["label"])
        _number_axis(axis, [r["value"] for r in rows if r["sweep"] == sweep])
        axis.set_ylabel(title)
        axis.set_ylim(bottom=0)
    for axis in axes[-1]:
        axis.set_xlabel(f"{label} [1]")
    headline(figure, f"Four figures of a lap of the paper's arm, by {label}")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    return figure


def _number_axis(axis: Axes, values: Sequence[float]) -> None:
    """Make the abscissa logarithmic, with ticks at values of a sweep that leave room for their numbers."""
    axis.set_xscale("log")
    ticks: list[float] = []
    for value in sorted(set(values)):
        if not ticks or value > 1.6 * ticks[-1]:
            ticks.append(value)
    number_ticks(axis.xaxis, ticks)


def alternatives(rows: Rows) -> Figure:
    """Draw the law's alternative readings: overshoot, or when the run ended."""
    chosen = [r for r in rows if r["sweep"] in ("alternatives", "current_jacobian", "elbow_branch")]
    names = list(dict.fromkeys(r["value"] for r in chosen))
    figure, axis = plt.subplots(figsize=(WIDTH, 0.68 * len(names) + 1.2))
    for offset, controller in ((0.18, "ifdc"), (-0.18, "flsac")):
        for y, name in enumerate(reversed(names)):
            for row in (r for r in chosen if r["value"] == name and r["controller"] == controller):
                whole = not row["ended_early"]
                value = row["rigid_overshoot"][0] if whole else 0.0
                axis.barh(y + offset, value, height=0.34, color=LINKS[controller == "flsac"])
                text = f"{value:.2f} m" if whole else f"lost at {row['duration']:.2f} s"
                axis.text(max(value, 0.0) + 0.01, y + offset, f"{CONTROLLER[controller]} {text}", va="center")
    axis.set_yticks(range(len(names)), [READINGS.get(name, name) for name in reversed(names)])
    axis.set(xlabel="overshoot of the rigid tip past the top left corner [m]", xlim=(0, 1.4))
    headline(figure, "Other readings of the paper's law: noncollocated sensor at the tip")
    return figure


def true_tip_feedback(rows: Rows) -> Figure:
    """Draw the same law fed with the true tip: how long runs last, and the error of those that last the lap."""
    figure, (left, right) = plt.subplots(1, 2, figsize=(WIDTH, 4.4), width_ratios=(3, 2))
    for sweep, text, style in (
        ("true_tip_feedback", "not delayed", {"linestyle": "-", "marker": "o"}),
        ("late_true_tip_feedback", "31.2 ms late", {"linestyle": "--", "marker": "s", "mfc": "white"}),
    ):
        chosen = [r for r in rows if r["sweep"] == sweep]
        for arm in dict.fromkeys(r["arm"] for r in chosen):
            mine = [r for r in chosen if r["arm"] == arm]
            look = style | {
                "markersize": 10 - 1.5 * len(left.lines),
                "color": TIP_COLORS[arm],
                "label": f"damping {100 * float(arm.split()[1]):g} %, {text}",
            }
            left.plot([r["value"] for r in mine], [r["duration"] for r in mine], **look)
            whole = [r for r in mine if not r["ended_early"]]
            right.plot([r["value"] for r in whole], [r["true_tip_rms"] for r in whole], **look)
    left.set(ylabel="run lasts [s]", yscale="log", title="how long runs last (a lap: 16 s)")
    number_ticks(left.yaxis, [0.05, 0.2, 1, 4, 16])
    _number_axis(left, [r["value"] for r in rows if r["sweep"] == "true_tip_feedback"])
    whole_laps = [r for r in rows if r["sweep"] in TIP_SWEEPS and not r["ended_early"]]
    right.set(ylabel="r.m.s. error of the true tip [m]", ylim=(0, None), title="error of whole laps")
    _number_axis(right, [r["value"] for r in whole_laps])
    for axis in (left, right):
        axis.set_xlabel("constant gain $\\lambda$ [1]")
    headline(figure, "The paper's law at constant gain, fed with the true tip")
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower left", ncols=2)
    return figure


OTHERS = {"alternatives": alternatives, "true_tip_feedback": true_tip_feedback}
