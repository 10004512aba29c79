"""Two pictures of committed records: error over lost share for every entry of the board; distances from a chain."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.text import Text
from matplotlib.transforms import Bbox

from flexarm_agents.board.summary import nominal_errors
from scripts.common.markdown import DOCS
from scripts.docs.arm_pictures import save
from scripts.docs.drawn_arm import BLUE, INK, ORANGE, SOFT

BOARD, RECORD = DOCS / "leaderboard.json", DOCS / "validation.json"
LEADER = {"arrowstyle": "-", "linewidth": 0.8, "shrinkA": 1, "shrinkB": 4}
ARROW = {"arrowstyle": "->", "color": SOFT}
KINDS = {"reads the true state": SOFT, "controller": BLUE, "trained network": ORANGE}
MODELS = {
    "linear, 2 modes": 'arm="linear"',
    "2 polynomials": "2 polynomials",
    "3 polynomials": "default arm:\n3 polynomials",
    "4 polynomials": "4 polynomials",
}
RUNS = {
    "plain, plan with gentle feedback, {}, rms": ("plain lap", BLUE, "o"),
    "swing, plan with gentle feedback, {}, rms": ("swing lap", ORANGE, "s"),
}


def error_over_loss(path: Path) -> None:
    """Draw the mean error of the two nominal laps over the share of unknown plants that is lost, for each entry."""
    entries = [one for row in json.loads(BOARD.read_text())["rows"] if (one := _entry(row)) is not None]
    figure, axis = plt.subplots(figsize=(8.6, 5.6))
    axis.set_yscale("log")
    axis.set_xlim(-3.0, 100.0)
    axis.set_ylim(22.0, 1400.0)
    axis.set_yticks([30, 100, 300, 1000], ["30", "100", "300", "1000"])
    axis.set_xlabel("lost on unknown arms [% of 256 drawn arms]")
    axis.set_ylabel("error on the default arm [mm],\nmean of both laps")
    for _, kind, lost, error in entries:
        axis.plot(lost, error, "o", color=KINDS[kind], markersize=8, clip_on=False)
    for n, (kind, colour) in enumerate(KINDS.items()):
        axis.text(0.99, 0.68 - 0.06 * n, kind, transform=axis.transAxes, ha="right", va="top", color=colour)
    axis.annotate("better", (10.0, 80.0), (18.0, 115.0), color=SOFT, arrowprops=ARROW)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    _label(axis, entries)
    save(figure, path)


def _entry(row: Mapping[str, Any]) -> tuple[str, str, float, float] | None:
    """Return name, kind, lost share [%] and error [mm] of an entry that completes both nominal laps."""
    errors = [one["rms"] for one in nominal_errors(row).values() if one is not None]
    point = row["columns"]["unknown"]["points"][0]
    if len(errors) < 2 or point is None or "not_applicable" in point:
        return None
    lost, episodes = (sum(lap[name] for lap in point.values()) for name in ("lost", "episodes"))
    name = row["name"].removeprefix("agent ")
    kind = "reads the true state" if row["privileged"] else "controller" if name == row["name"] else "trained network"
    return name, kind, 100.0 * lost / episodes, 1e3 * float(np.mean(errors))


def _label(axis: Axes, entries: list[tuple[str, str, float, float]]) -> None:
    """Write each name beside its dot, where it covers no dot and no other name."""
    pixels = axis.transData.transform([(lost, error) for _, _, lost, error in entries])
    taken = [Bbox.from_bounds(x - 7.0, y - 7.0, 14.0, 14.0) for x, y in pixels]
    turns = np.radians(np.arange(0.0, 360.0, 15.0))
    offsets = [(r * np.cos(turn), r * np.sin(turn)) for r in (9.0, 18.0, 28.0, 40.0, 54.0, 70.0) for turn in turns]
    for name, kind, lost, error in sorted(entries, key=lambda one: one[3]):
        for offset in offsets:
            text = axis.annotate(
                name,
                (lost, error),
                offset,
                textcoords="offset points",
                ha="left" if offset[0] > 1.0 else "right" if offset[0] < -1.0 else "center",
                va="center",
                fontsize=10,
                color=INK,
                arrowprops=LEADER | {"color": KINDS[kind]} if np.hypot(*offset) > 9.5 else None,
            )
            text.get_window_extent()  # places the text
            box = Text.get_window_extent(text).padded(1.5)
            if axis.bbox.x0 < box.x0 and not any(box.overlaps(other) for other in taken):
                taken.append(box)
                break
            text.remove()


def distance_from_chain(path: Path) -> None:
    """Draw how far each model of the arm is from a chain of rigid segments in MuJoCo, along the best plans known."""
    quoted = json.loads(RECORD.read_text())["groups"]["plant"]["quoted"]
    figure, axis = plt.subplots(figsize=(8.6, 3.0))
    for row, model in enumerate(reversed(MODELS)):
        for pattern, (title, colour, marker) in RUNS.items():
            away = quoted[pattern.format(model)]
            axis.plot(away, row, marker, color=colour, markersize=9)
            offset = (0, 9 if marker == "o" else -19)
            axis.annotate(
                f"{away:.0f}", (away, row), offset, textcoords="offset points", ha="center", fontsize=11, color=colour
            )
            if row == len(MODELS) - 1:
                axis.annotate(
                    title, (away, row), (14, offset[1]), textcoords="offset points", fontsize=11, color=colour
                )
    axis.set_yticks(range(len(MODELS)), list(reversed(MODELS.values())))
    axis.set_ylim(-0.6, len(MODELS) - 0.4)
    axis.set_xlim(0.0, 70.0)
    axis.set_xlabel("r.m.s. distance of the tip from the MuJoCo chain's over a lap of 16 s [mm]")
    save(figure, path)
