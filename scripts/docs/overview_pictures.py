"""Pictures of committed records: entries of the board on unknown arms and with a payload; distances from a chain."""

import json
from collections.abc import Mapping, Sequence
from itertools import product, takewhile
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

from flexarm_agents.board.measure import PUBLISHED
from flexarm_agents.board.summary import loss
from scripts.common import plotting
from scripts.common.markdown import DOCS
from scripts.common.plotting import BLUE, COLOURS, INK, ORANGE, SOFT, WIDTH, headline, label_ends, plain_ticks, write

RECORD = DOCS / "validation.json"
INFINITE = 2500.0  # where an infinite error is drawn [mm]
LEADER = {"arrowstyle": "-", "linewidth": 0.8, "shrinkA": 1, "shrinkB": 4}
KINDS = {"reads the true state": SOFT, "controller": BLUE, "trained network": ORANGE}
MODELS = {
    "linear, 2 modes": "linear arm",
    "2 polynomials": "2 shapes a link",
    "3 polynomials": "default arm:\n3 shapes a link",
    "4 polynomials": "4 shapes a link",
}
LOADED = {"lqg": COLOURS[4], "lqg_adaptive": BLUE, "nmpc_adaptive": COLOURS[5], "agent square": ORANGE}
LOADED |= {"agent student": COLOURS[2], "agent student_unknown": COLOURS[3]}
RUNS = {
    "plain, plan with gentle feedback, {}, rms": ("plain lap", BLUE, "o"),
    "swing, plan with gentle feedback, {}, rms": ("swing lap", ORANGE, "s"),
}


def error_over_loss(path: Path) -> None:
    """Draw the median error on unknown arms over the share of them that is lost, for each entry."""
    board = json.loads(PUBLISHED.read_text())
    dots = [dot for row in board["rows"] if (dot := _dot(row)) is not None]
    figure, axis = plt.subplots(figsize=(WIDTH, 6.4))
    axis.set_yscale("log")
    axis.set_xscale("symlog", linthresh=2.0, linscale=1.0)
    axis.set(xlim=(-1.1, 140.0), ylim=(20.0, 1.6 * INFINITE))
    plotting.number_ticks(axis.xaxis, (0, 1, 2, 5, 10, 20, 50, 100))
    plotting.number_ticks(axis.yaxis, (20, 50, 100, 200, 500, 1000))
    axis.set_yticks([*axis.get_yticks(), INFINITE], [*(one.get_text() for one in axis.get_yticklabels()), "infinite"])
    axis.set_xlabel("lost [% of 256 unknown arms]")
    axis.set_ylabel("median error on unknown arms [mm]; a lost lap's is infinite")
    for _, colour, *place in dots:
        axis.plot(*place, "o", color=colour, markersize=8, clip_on=False)
    for n, (kind, colour) in enumerate(KINDS.items()):
        axis.text(0.99, 0.18 - 0.05 * n, kind, transform=axis.transAxes, ha="right", va="top", color=colour)
    headline(figure, "All entries: what becomes of laps on arms that they do not know")
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    label_dots(axis, [dot for dot in dots if dot[3] < INFINITE])
    names = ", ".join(name for name, *_, error in sorted(dots, key=lambda dot: dot[2]) if error == INFINITE)
    axis.text(0.05, 0.98, fill(f"Infinite, from left to right: {names}", 80), transform=axis.transAxes, va="top")
    write(figure, path)


def _dot(row: Mapping[str, Any]) -> tuple[str, str, float, float] | None:
    """Return name, colour, lost share [%] and median error [mm] of an entry that was measured on unknown arms."""
    whole = row["columns"]["unknown"].get("whole")
    if whole is None:
        return None
    name = row["name"].removeprefix("agent ")
    kind = "reads the true state" if row["privileged"] else "controller" if name == row["name"] else "trained network"
    median = whole["rms"] and whole["rms"]["median"]
    return name, KINDS[kind], 100.0 * whole["lost"] / whole["episodes"], 1e3 * median if median else INFINITE


def label_dots(axis: Axes, dots: Sequence[tuple[str, str, float, float]], others: Sequence[Any] = ()) -> None:
    """Write each name beside its dot, where it covers no dot, no other name and no leader.

    Its own leader crosses no dot and no name if there is such a place.
    """

    def boxes(places: Any, size: float) -> Any:
        return np.hstack([np.subtract(places, size), np.add(places, size)])

    def meet(some: Any, others: Any) -> bool:
        along = (some[:, None, :2] <= others[:, 2:]) & (others[:, :2] <= some[:, None, 2:])
        return bool(np.any(np.all(along, axis=-1)))

    scale, frame = axis.figure.dpi / 72.0, np.array([axis.bbox.x0, axis.bbox.y0, axis.figure.bbox.x1, np.inf])
    taken = boxes(axis.transData.transform([*(place for _, _, *place in dots), *others]), 7.0)
    marks = taken[: len(dots)]  # and names: what leaders should not cross
    turns = np.radians(np.arange(0.0, 360.0, 5.0))
    offsets = [(r * np.cos(turn), r * np.sin(turn)) for r in (9, 18, 28, 40, 54, 70, 90, 115, 145) for turn in turns]
    for name, colour, *place in sorted(dots, key=lambda dot: (-dot[2], dot[3])):
        start, written = axis.transData.transform(place), axis.text(0.0, 0.0, name, transform=axis.transAxes)
        size = np.array(written.get_window_extent().size)
        written.remove()
        for free, offset in product((True, False), offsets):
            side = 0.0 if offset[0] > 1.0 else 1.0 if offset[0] < -1.0 else 0.5  # of the name, where the leader ends
            corner = start + scale * np.array(offset) - size * (side, 0.5)
            box = np.hstack([corner - 1.5, corner + size + 1.5])[None]
            inside = (frame[:2] < box[0, :2]).all() and (box[0, 2:] < frame[2:]).all()
            if not inside or meet(box, taken):
                continue
            leader = boxes(start + np.linspace(9.0 / np.hypot(*offset), 1.0, 60)[:, None] * scale * offset, 0.5)
            if not (free and meet(leader, marks)):
                look = LEADER | {"color": colour, "relpos": (side, 0.5)}
                axis.annotate(
                    name,
                    (place[0], place[1]),
                    offset,
                    textcoords="offset points",
                    ha={0.0: "left", 0.5: "center", 1.0: "right"}[side],
                    va="center",
                    color=INK,
                    arrowprops=look if np.hypot(*offset) > 9.5 else None,
                )
                taken, marks = np.vstack([taken, box, leader]), np.vstack([marks, box])
                break


def distance_from_chain(path: Path) -> None:
    """Draw how far each model of the arm is from a chain of rigid segments in MuJoCo, along the best plans known."""
    quoted = json.loads(RECORD.read_text())["groups"]["plant"]["quoted"]
    figure, axis = plt.subplots(figsize=(WIDTH, 3.2))
    for row, model in enumerate(reversed(MODELS)):
        for pattern, (title, colour, marker) in RUNS.items():
            away = quoted[pattern.format(model)]
            axis.plot(away, row, marker, color=colour, markersize=9)
            offset = (0, 9 if marker == "o" else -19)
            axis.annotate(f"{away:.0f}", (away, row), offset, textcoords="offset points", ha="center", color=colour)
            if row == len(MODELS) - 1:
                axis.annotate(title, (away, row), (14, offset[1]), textcoords="offset points", color=colour)
    axis.set_yticks(range(len(MODELS)), list(reversed(MODELS.values())))
    axis.set_ylim(-0.6, len(MODELS) - 0.4)
    axis.set_xlim(0.0, 70.0)
    axis.set_xlabel("r.m.s. distance of the tip from the MuJoCo chain's over a lap of 16 s [mm]")
    headline(figure, "Four models of the arm against a chain of segments in MuJoCo, along the best plans")
    write(figure, path)


def payload(path: Path) -> None:
    """Draw some entries' errors over a payload of which they are not told, as far as no lap is lost."""
    board = json.loads(PUBLISHED.read_text())
    values = board["columns"]["payload"]["values"]
    figure, axis = plt.subplots(figsize=(WIDTH, 4.2))
    axis.set(yscale="log", xlim=(0.0, values[-1] + 0.02), ylim=(28.0, 450.0))
    axis.set(xlabel="payload of which the entry is not told [kg]", ylabel="error, mean of both laps [mm]")
    plain_ticks(axis.yaxis)
    ends = {}
    for row in board["rows"]:
        if row["name"] in LOADED:
            name, colour = row["name"].removeprefix("agent "), LOADED[row["name"]]
            points = [list(point.values()) for point in row["columns"]["payload"]["points"]]
            kept = takewhile(lambda laps: not loss(laps), points)
            errors = [1e3 * float(np.mean([lap["rms"]["mean"] for lap in laps])) for laps in kept]
            axis.plot(values[: len(errors)], errors, "o-", color=colour, linewidth=1.8)
            if len(errors) == len(values):
                ends[name, colour] = errors[-1]
            else:
                at, text = (values[len(errors) - 1], errors[-1]), f"{name}, lost\nfrom {values[len(errors)]:g} kg"
                axis.annotate(text, at, (4, 14), textcoords="offset points", color=colour)
    label_ends(axis, [*ends], [*ends.values()])
    headline(figure, "Six entries on arms that carry a payload")
    write(figure, path)
