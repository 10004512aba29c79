"""The board as Markdown tables."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from flexarm_agents.board.columns import COLUMNS
from flexarm_agents.board.summary import LIMIT, counted, gap, loss, nominal_errors, spans, within
from flexarm_env.laps import LAPS

Board = Mapping[str, Any]
MOST_VALUES = 13  # columns of an axis's table
PRIVILEGED = "\\*"  # after the name of a privileged entry
UNRANKED = "*Without a rank:*"  # above the privileged entries
ABSENT = "not applicable"
NONE = "none"  # the nominal lap itself is lost
HOLDING = (("lost",), ("lost", "doubled"))  # what must not happen: see `flexarm_agents.board.summary.breaking`
UNKNOWN = (  # heads
    "unknown arms: lost",
    f"error, a lost lap as {LIMIT:g} m [mm]",
    "mean of the completed laps [mm]",
)
SHORT = ("lqg", "lqg_adaptive", "nmpc_adaptive", "agent square", "agent student", "agent student_unknown")


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a Markdown table, one line a row; pipes in cells are escaped."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


def ranked(board: Board) -> list[Mapping[str, Any]]:
    """Return the entries in order: by the error on unknown arms, where lost laps count, then by the nominal laps.

    Privileged entries, which have no rank, come last.
    """

    def rank(entry: Mapping[str, Any]) -> tuple[bool, float, int, float, str]:
        errors = [one["rms"] for one in nominal_errors(entry).values() if one is not None]
        error = counted(laps) if (laps := _unknown_laps(entry)) else np.inf
        return entry["privileged"], error, len(LAPS) - len(errors), sum(errors), entry["name"]

    return sorted(board["rows"], key=rank)


def title(entry: Mapping[str, Any]) -> str:
    """Return an entry's name, marked if it is privileged."""
    return f"{entry['name']}{PRIVILEGED if entry['privileged'] else ''}"


def ranking(board: Board) -> str:
    """Write what becomes of each entry on unknown arms, its nominal errors, and what it reads."""
    unknown = "unknown" in board["columns"]
    head = ["entry", *(UNKNOWN if unknown else ()), *(f"{lap}: lap / after 2 s [mm]" for lap in LAPS)]
    head += ["gap, " + " / ".join(LAPS), "reads"]
    lines: list[list[str]] = []
    for entry in ranked(board):
        if entry["privileged"] and UNRANKED not in [line[0] for line in lines]:
            lines.append([UNRANKED, *[""] * (len(head) - 1)])
        errors = nominal_errors(entry)
        gaps = [None if one is None else gap(board, lap, one["rms"]) for lap, one in errors.items()]
        line = [title(entry), *(_unknown(entry) if unknown else []), *map(_errors, errors.values())]
        line.append(" / ".join("-" if one is None else f"{one:.3f}" for one in gaps))
        lines.append([*line, ", ".join(entry["reads"]) or "nothing"])
    return table(head, lines)


def short_ranking(board: Board, names: Collection[str] = SHORT) -> str:
    """Write a few entries of the ranking in one line each: losses and mean error on unknown arms, nominal errors."""
    lines = []
    for entry in ranked(board):
        laps, errors = _unknown_laps(entry), nominal_errors(entry).values()
        if entry["name"] in names and laps:
            cells = ["lost" if one is None else millimetres(one["rms"]) for one in errors]
            lines.append([title(entry), share(loss(laps)), millimetres(counted(laps)), *cells])
    return table(["entry", "lost", "error, unknown arms [mm]", *(f"{lap} lap [mm]" for lap in LAPS)], lines)


def nominal(board: Board) -> str:
    """Write the errors on every nominal task."""
    values = board["columns"]["nominal"]["values"]
    head = [
        "entry",
        *(f"{value}: {' / '.join(LAPS) if value != 'reach' else 'mean, successes'} [mm]" for value in values),
    ]
    tasks = board["columns"]["nominal"]["tasks"]
    rows = [
        [
            title(entry),
            *(point_text(*one, board) for one in zip(entry["columns"]["nominal"]["points"], tasks, strict=True)),
        ]
        for entry in ranked(board)
    ]
    return table(head, rows)


def axis(name: str, board: Board) -> str:
    """Write the errors along one axis, at some of its values."""
    column = board["columns"][name]
    chosen = _some(len(column["values"]), COLUMNS[name].nominal_index)
    unit = f" {column['unit']}" if column["unit"] not in ("", "1") else ""
    head = [f"{column['title']}", *(f"{_number(column['values'][n])}{unit}" for n in chosen)]
    rows = [
        [title(entry), *(point_text(entry["columns"][name]["points"][n], column["tasks"][n], board) for n in chosen)]
        for entry in ranked(board)
    ]
    return table(head, [row for row in rows if set(row[1:]) != {ABSENT}])


def robustness(board: Board) -> str:
    """Write how far each axis of numbers may go, from the nominal value, before a lap is lost or an error doubled."""
    names = [name for name in board["columns"] if any("breaking" in entry["columns"][name] for entry in board["rows"])]
    heads = [_range(board["columns"][name]) for name in names]
    lines = [[title(entry), *(_holds(name, entry, board) for name in names)] for entry in ranked(board)]
    return table(["entry", *heads], lines)


def _range(column: Mapping[str, Any]) -> str:
    """Write an axis's title and its first and last value."""
    unit = f" {column['unit']}" if column["unit"] not in ("", "1") else ""
    least, most = (_number(column["values"][end]) for end in (0, -1))
    return f"{column['title']}, {least} to {most}{unit}"


def _holds(name: str, entry: Mapping[str, Any], board: Board) -> str:
    """Write the values about the nominal one without a lost lap, and those without a doubled error, if fewer."""
    column = entry["columns"][name]
    points = zip(board["columns"][name]["values"], column["points"], strict=True)
    values = [value for value, point in points if point is not None and "not_applicable" not in point]
    if len(values) < 2:
        return ABSENT
    laps = column["breaking"].values()
    if any(one["complete"] is not None for one in laps):
        return NONE
    complete, good = (_inside(values, [one[what] for one in laps for what in whats]) for whats in HOLDING)
    return complete if complete == good else f"{complete} ({good})"


def _inside(values: Sequence[float], ends: Sequence[Mapping[str, float | None]]) -> str:
    """Write the values of an axis that lie within all ends."""
    found = within(values, ends)
    return "all" if len(found) == len(values) else spans(values, found)


def _unknown_laps(entry: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the sums of an entry's laps on unknown arms; none where they are not applicable or not measured."""
    column = entry["columns"].get("unknown")
    point = column and column["points"][0]
    return [] if not point or "not_applicable" in point else [point[lap] for lap in LAPS]


def _unknown(entry: Mapping[str, Any]) -> list[str]:
    """Write the columns `UNKNOWN`."""
    laps = _unknown_laps(entry)
    if not laps:
        return ["-"] * len(UNKNOWN)
    completed = ("-" if one["rms"] is None else millimetres(one["rms"]["mean"]) for one in laps)
    return [share(loss(laps)), " / ".join(millimetres(counted([one])) for one in laps), " / ".join(completed)]


def share(part: float) -> str:
    """Write a share in percent."""
    return f"{100.0 * part:.1f} %"


def millimetres(metres: float) -> str:
    """Write an error in mm, to a tenth of it below 100 mm."""
    return f"{1e3 * metres:.{1 if metres < 0.09995 else 0}f}"


def _errors(errors: Mapping[str, float] | None) -> str:
    return "lost" if errors is None else f"{millimetres(errors['rms'])} / {millimetres(errors['rms_after_2s'])}"


def point_text(point: Mapping[str, Any] | None, task: str, board: Board) -> str:
    """Write the headline figure of a point's laps, with its range, or how many were lost and when the first one was."""
    if point is None:
        return "-"
    if "not_applicable" in point:
        return ABSENT
    name, figure = next(iter(board["tasks"][task]["figures"].items()))
    return " / ".join(_lap(one, name, figure["unit"]) for one in point.values())


def _lap(one: Mapping[str, Any], name: str, unit: str) -> str:
    if one["lost"] or one[name] is None:
        part = "" if one["episodes"] == 1 else f" {one['lost']} of {one['episodes']}"
        return f"lost{part} at {one['first_loss']:.1f} s" if one["lost"] else "-"
    goal = f", {100.0 * one['success']:.0f} %" if "success" in one else ""
    mean, least, most = (amount(one[name][what], unit) for what in ("mean", "least", "most"))
    return f"{mean}{goal}" if least == most else f"{mean} ({least} to {most}){goal}"


def amount(value: float, unit: str) -> str:
    """Write a figure: an error in mm (`millimetres`), others with three digits."""
    return millimetres(value) if unit == "m" else f"{value:.3g}"


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
        writers |= {"ranking": ranking, "nominal": nominal, "robustness": robustness}
        writers |= {f"axis_{name}": partial(axis, name) for name in names if name not in ("nominal", "unknown")}
        writers |= {"short_ranking": short_ranking} if "unknown" in names else {}
    for name, write in writers.items():
        found[name] = write(board)
    return found
