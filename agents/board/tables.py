"""The board as Markdown tables."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from flexarm_agents.board.columns import COLUMNS
from flexarm_agents.board.references import gap
from flexarm_agents.board.summary import nominal_errors
from flexarm_agents.markdown import table
from flexarm_env.laps import LAPS

Board = Mapping[str, Any]
MOST_VALUES = 13  # columns of an axis's table
PRIVILEGED = "\\*"  # after the name of a privileged row
ABSENT = "not applicable"


def ranked(board: Board) -> list[Mapping[str, Any]]:
    """Return the rows in the order of the mean error of their nominal laps; those with lost laps come last."""

    def rank(row: Mapping[str, Any]) -> tuple[int, float, str]:
        errors = [one["rms"] for one in nominal_errors(row).values() if one is not None]
        return len(LAPS) - len(errors), sum(errors), row["name"]

    return sorted(board["rows"], key=rank)


def title(row: Mapping[str, Any]) -> str:
    """Return a row's name, marked if it is privileged."""
    return f"{row['name']}{PRIVILEGED if row['privileged'] else ''}"


def ranking(board: Board) -> str:
    """Write what each row reads, its nominal errors, and what becomes of it on the unknown plant."""
    head = ["row", "reads", *(f"{lap}: lap / after 2 s [m]" for lap in LAPS), "gap, " + " / ".join(LAPS)]
    unknown = "unknown" in board["columns"]
    head += ["unknown plant: mean [m]", "worst [m]", "lost"] if unknown else []
    lines = []
    for row in ranked(board):
        errors = nominal_errors(row)
        gaps = [None if one is None else gap(board, lap, one["rms"]) for lap, one in errors.items()]
        line = [title(row), ", ".join(row["reads"]) or "nothing", *map(_errors, errors.values())]
        line.append(" / ".join("-" if one is None else f"{one:.3f}" for one in gaps))
        lines.append(line + (_unknown(row) if unknown else []))
    return table(head, lines)


def nominal(board: Board) -> str:
    """Write the errors on every nominal task."""
    values = board["columns"]["nominal"]["values"]
    head = ["row", *(f"{value}: {' / '.join(LAPS) if value != 'reach' else 'mean, successes'} [m]" for value in values)]
    rows = [[title(row), *map(_point, row["columns"]["nominal"]["points"])] for row in ranked(board)]
    return table(head, rows)


def axis(name: str, board: Board) -> str:
    """Write the errors along one axis, at some of its values."""
    column = board["columns"][name]
    chosen = _some(len(column["values"]), COLUMNS[name].nominal_index)
    unit = f" {column['unit']}" if column["unit"] not in ("", "1") else ""
    head = [f"{column['title']}", *(f"{_number(column['values'][n])}{unit}" for n in chosen)]
    rows = [[title(row), *(_point(row["columns"][name]["points"][n]) for n in chosen)] for row in ranked(board)]
    return table(head, rows)


def breaks(board: Board) -> str:
    """Write where on each axis of numbers a lap's error is first twice the nominal one, and where it is lost."""
    names = [name for name in board["columns"] if any("breaking" in row["columns"][name] for row in board["rows"])]
    heads = [f"{COLUMNS[name].title} [{COLUMNS[name].unit}]" for name in names]
    lines = [[title(row), *(_break(row["columns"][name]) for name in names)] for row in ranked(board)]
    return table(["row", *heads], lines)


def margins(board: Board) -> str:
    """Write the exact delay margins of linear loops beside the delays at which they fail in simulation."""
    lines = []
    for row in board["rows"]:
        margin = row["delay_margin"]
        if margin is not None:
            exact = " to ".join(f"{1e3 * margin[end]:.3g}" for end in ("least", "most"))
            lines.append([title(row), exact, _break(row["columns"]["delay"])])
    return table(["row", "exact margin along the square [ms]", "simulated laps [ms]"], lines)


def _break(column: Mapping[str, Any]) -> str:
    if all(point is None or "not_applicable" in point for point in column["points"]):
        return ABSENT
    return "; ".join(told for lap, one in column["breaking"].items() if (told := _fails(lap, one))) or "holds"


def _fails(lap: str, one: Mapping[str, Any]) -> str:
    """Say where a lap's error is doubled, and where it is lost."""
    told = []
    for what, mark in (("doubled", "2×"), ("lost", "lost")):
        for side, sign in (("low", "≤"), ("high", "≥")):
            if one[what][side] is not None:
                told.append(f"{mark} {sign} {_number(one[what][side])}")
    return f"{lap} {', '.join(told)}" if told else ""


def _unknown(row: Mapping[str, Any]) -> list[str]:
    point = row["columns"]["unknown"]["points"][0]
    if point is None or "not_applicable" in point:
        return ["-"] * 3
    laps = [point[lap] for lap in LAPS]
    means = " / ".join("-" if one["rms"] is None else f"{one['rms']['mean']:.3f}" for one in laps)
    worst = " / ".join("-" if one["rms"] is None else f"{one['rms']['most']:.3f}" for one in laps)
    lost, total = (sum(one[name] for one in laps) for name in ("lost", "episodes"))
    return [means, worst, f"{100.0 * lost / total:.1f} %"]


def _errors(errors: Mapping[str, float] | None) -> str:
    return "lost" if errors is None else f"{errors['rms']:.4f} / {errors['rms_after_2s']:.4f}"


def _point(point: Mapping[str, Any] | None) -> str:
    """Write the errors of a point's laps, with their range, or how many were lost and when the first one was."""
    if point is None:
        return "-"
    if "not_applicable" in point:
        return ABSENT
    return " / ".join(_lap(one) for one in point.values())


def _lap(one: Mapping[str, Any]) -> str:
    if one["lost"]:
        share = "" if one["episodes"] == 1 else f" {one['lost']} of {one['episodes']}"
        return f"lost{share} at {one['first_loss']:.1f} s"
    goal = f", {100.0 * one['success']:.0f} %" if "success" in one else ""
    mean, least, most = (f"{one['rms'][name]:.3f}" for name in ("mean", "least", "most"))
    return f"{mean}{goal}" if least == most else f"{mean} ({least} to {most}){goal}"


def _some(count: int, kept: int) -> list[int]:
    """Choose at most `MOST_VALUES` of the values of an axis, evenly spaced, the nominal one among them."""
    step = -(-count // MOST_VALUES)
    return list(range(kept % step, count, step))


def _number(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def tables(board: Board) -> dict[str, str]:
    """Write every table for which the board has the columns."""
    found: dict[str, str] = {}
    names: Sequence[str] = tuple(board["columns"])
    writers: dict[str, Callable[[Board], str]] = {}
    if "nominal" in names:
        writers |= {"ranking": ranking, "nominal": nominal, "breaks": breaks}
        writers |= {f"axis_{name}": partial(axis, name) for name in names if name not in ("nominal", "unknown")}
        writers |= {"margins": margins} if "delay" in names else {}
    for name, write in writers.items():
        found[name] = write(board)
    return found
