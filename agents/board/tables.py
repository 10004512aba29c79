"""The board as Markdown tables."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from flexarm_agents.board.columns import COLUMNS
from flexarm_agents.board.summary import nominal_errors, spans, value_text
from flexarm_env.laps import LAPS

Board = Mapping[str, Any]
Entry = Mapping[str, Any]
MOST_VALUES = 13  # columns of an axis's table
PRIVILEGED, UNLIMITED = "\\*", "†"  # after the name of an entry that reads the true state, or has no limit of torque
UNRANKED = "*Without a rank:*"  # above these entries
ABSENT = "not applicable"
LOST = "lost"
UNKNOWN = ("unknown arms: lost (95 %)", "median [mm]", "90th percentile [mm]")  # heads
NOMINAL = tuple(f"{lap} lap [mm]" for lap in LAPS)
# Entries of the short table.
SHORT = ("lqg", "lqg_adaptive", "nmpc_adaptive", "agent square", "agent student_unknown", "agent unknown")


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a Markdown table, one line a row; pipes in cells are escaped."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


def has_rank(entry: Entry) -> bool:
    """Return whether an entry has a rank: it does not read the true state, and its torques have a limit."""
    return not entry["privileged"] and entry["torque_limit"] is not None


def ranked(board: Board) -> list[Entry]:
    """Return the entries in order; those without a rank come last.

    First comes the least 90th percentile of the error on unknown arms, where a lost lap is infinite; where more than a
    tenth are lost the least share of them, then the least median; then the nominal laps.
    """

    def rank(entry: Entry) -> tuple[Any, ...]:
        whole = _unknown(entry)
        errors = [one["rms"] for one in nominal_errors(entry).values() if one is not None]
        first = [_or_infinite(whole["rms"], "p90"), whole["lost"] / whole["episodes"]] if whole else [np.inf, 1.0]
        median = _or_infinite(whole["rms"], "median") if whole else np.inf
        return not has_rank(entry), *first, median, -len(errors), sum(errors), entry["name"]

    return sorted(board["rows"], key=rank)


def _or_infinite(figure: Mapping[str, float | None] | None, what: str) -> float:
    """Return a quantile of a figure; infinity where too many were lost."""
    value = None if figure is None else figure[what]
    return np.inf if value is None else value


def on_square(entry: Entry) -> bool:
    """Return whether the ranking lists an entry: it completes a nominal lap of the square, or ran on unknown arms."""
    return any(one is not None for one in nominal_errors(entry).values()) or _unknown(entry) is not None


def place(board: Board, name: str) -> tuple[int, int] | None:
    """Return an entry's rank, from 1, and how many entries have one; None for one without a rank."""
    names = [entry["name"] for entry in filter(on_square, ranked(board)) if has_rank(entry)]
    return (names.index(name) + 1, len(names)) if name in names else None


def title(entry: Entry) -> str:
    """Return an entry's name, marked if it has no rank."""
    marks = PRIVILEGED * entry["privileged"] + UNLIMITED * (entry["torque_limit"] is None)
    return f"{entry['name']}{marks}"


class Best(NamedTuple):
    """A figure of a nominal task, with the best value known of each lap."""

    task: str
    figure: str
    values: Mapping[str, float]  # of each lap

    def over(self, entry: Entry, board: Board) -> Iterator[float | None]:
        """Yield by how much an entry's figure exceeds the best of each lap; None where it has none, or lost the lap."""
        index = board["columns"]["nominal"]["tasks"].index(self.task)
        point = entry["columns"]["nominal"]["points"][index] or {}
        for lap, best in self.values.items():
            found = point.get(lap)
            figure = None if found is None or found["lost"] else found[self.figure]
            yield None if figure is None else figure["mean"] - best


def best_of(board: Board) -> Iterator[Best]:
    """Yield the figures of the nominal tasks whose best values are known."""
    for task in board["columns"]["nominal"]["tasks"] if "nominal" in board["columns"] else ():
        for figure in board["tasks"][task]["figures"]:
            values = {lap: own[figure] for lap, own in board["tasks"][task]["best"].items() if figure in own}
            if values:
                yield Best(task, figure, values)


def ranking(board: Board) -> str:
    """Write each entry's losses and errors on unknown arms, its distance to the plans, and what it reads."""
    best = list(best_of(board))
    titles = [f"{one.task}, {board['tasks'][one.task]['figures'][one.figure]['title']}" for one in best]
    laps = [" / ".join(one.values) for one in best]
    over = [f"{name}: over the best plan, {each} [mm]" for name, each in zip(titles, laps, strict=True)]

    def cells(entry: Entry) -> list[str]:
        each = (one.over(entry, board) for one in best)
        written = [" / ".join(LOST if one is None else signed(one) for one in own) for own in each]
        return [*written, ", ".join(entry["reads"]) or "nothing"]

    return _ranking(board, (*over, "reads"), cells)


def lap_ranking(board: Board) -> str:
    """Write each entry's losses and errors on unknown arms, and the errors of its nominal laps: few, narrow columns."""
    return _ranking(board, NOMINAL, nominal_cells)


def _ranking(board: Board, heads: Sequence[str], cells: Callable[[Entry], list[str]]) -> str:
    head = ["rank", "entry", *UNKNOWN, *heads]
    lines: list[list[str]] = []
    for entry in filter(on_square, ranked(board)):
        if not has_rank(entry) and UNRANKED not in [line[1] for line in lines]:
            lines.append(["", UNRANKED, *[""] * (len(head) - 2)])
        number = str(len(lines) + 1) if has_rank(entry) else ""
        lines.append([number, title(entry), *unknown_cells(entry), *cells(entry)])
    return table(head, lines)


def short_ranking(board: Board) -> str:
    """Write a few entries of the ranking in one line each: unknown arms, and the errors of the nominal laps."""
    lines = [
        [title(entry), *unknown_cells(entry), *nominal_cells(entry)]
        for entry in ranked(board)
        if entry["name"] in SHORT
    ]
    return table(["entry", *UNKNOWN, *NOMINAL], lines)


def nominal(board: Board) -> str:
    """Write the headline figures of every nominal task."""
    column = board["columns"]["nominal"]
    heads = []
    for value, task in zip(column["values"], column["tasks"], strict=True):
        points = (entry["columns"]["nominal"]["points"][column["tasks"].index(task)] for entry in board["rows"])
        laps = next((list(point) for point in points if point and "not_applicable" not in point), [])
        unit = next(iter(board["tasks"][task]["figures"].values()))["unit"]
        laps_text = " / ".join(laps) if "all" not in laps else "mean, successes"
        heads.append(f"{value}: {laps_text} [{'mm' if unit == 'm' else unit}]")
    return _points("entry", heads, "nominal", range(len(heads)), board)


def axis(name: str, board: Board) -> str:
    """Write the headline figures along one axis, at some of its values."""
    column = board["columns"][name]
    chosen = _some(len(column["values"]), COLUMNS[name].nominal_index)
    unit = f" {column['unit']}" if column["unit"] not in ("", "1") else ""
    return _points(column["title"], [f"{value_text(column['values'][n])}{unit}" for n in chosen], name, chosen, board)


def _points(first: str, heads: Sequence[str], name: str, chosen: Sequence[int], board: Board) -> str:
    tasks = board["columns"][name]["tasks"]
    lines = [
        [title(entry), *(point_text(entry["columns"][name]["points"][n], tasks[n], board) for n in chosen)]
        for entry in ranked(board)
    ]
    return table([first, *heads], _able(lines))


def _able(lines: Iterable[Sequence[str]]) -> list[Sequence[str]]:
    return [line for line in lines if {*line[1:]} != {ABSENT}]


def robustness(board: Board) -> str:
    """Write from where to where each axis of numbers may go, about the nominal value, before a lap is lost."""
    names = _with_ends(board)
    heads = [_range(board["columns"][name]) for name in names]
    lines = [[title(entry), *(_kept(entry["columns"][name]) for name in names)] for entry in ranked(board)]
    return table(["entry", *heads], _able(lines))


def _with_ends(board: Board) -> list[str]:
    """Return the names of the axes of numbers."""
    return [name for name in board["columns"] if any("kept" in entry["columns"][name] for entry in board["rows"])]


def _range(column: Mapping[str, Any]) -> str:
    unit = f" {column['unit']}" if column["unit"] not in ("", "1") else ""
    least, most = (value_text(column["values"][end]) for end in (0, -1))
    return f"{column['title']}, {least} to {most}{unit}"


def _kept(column: Mapping[str, Any]) -> str:
    """Write the values about the nominal one without a lost lap."""
    able = sum(point is not None and "not_applicable" not in point for point in column["points"])
    if able < 2:
        return ABSENT
    return "all" if len(column["kept"]) == able else spans(column["kept"]) or "none"


def _unknown(entry: Entry) -> Mapping[str, Any] | None:
    """Return the sum of an entry's episodes on unknown arms; None where they are not applicable or not measured."""
    return entry["columns"].get("unknown", {}).get("whole")


def unknown_cells(entry: Entry) -> list[str]:
    """Write the columns `UNKNOWN`."""
    whole = _unknown(entry)
    if whole is None:
        return ["-"] * len(UNKNOWN)
    low, high = (f"{100.0 * end:.1f}" for end in whole["loss_interval"])
    quantiles = (_or_infinite(whole["rms"], what) for what in ("median", "p90"))
    cells = [LOST if np.isinf(one) else millimetres(one) for one in quantiles]
    return [f"{100.0 * (whole['lost'] / whole['episodes']):.1f} % ({low} to {high})", *cells]


def nominal_cells(entry: Entry) -> list[str]:
    """Write the columns `NOMINAL`."""
    return [LOST if one is None else millimetres(one["rms"]) for one in nominal_errors(entry).values()]


def millimetres(metres: float) -> str:
    """Write an error in mm, to a tenth of it below 100 mm."""
    return f"{1e3 * metres:.{1 if metres < 0.09995 else 0}f}"


def signed(metres: float) -> str:
    """Write how much an error is above another one in mm; to a hundredth below 10 mm."""
    digits = 2 if abs(metres) < 0.009995 else 1 if abs(metres) < 0.09995 else 0
    return f"{round(1e3 * metres, digits) + 0.0:+.{digits}f}"  # no negative zero


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


def tables(board: Board) -> dict[str, str]:
    """Write every table for which the board has the columns."""
    names: Sequence[str] = tuple(board["columns"])
    writers: dict[str, Callable[[Board], str]] = {}
    if "nominal" in names:
        writers |= {"ranking": ranking, "nominal": nominal}
        if _with_ends(board):
            writers["robustness"] = robustness
        if "unknown" in names and any(entry["name"] in SHORT for entry in board["rows"]):
            writers["short_ranking"] = short_ranking
    writers |= {f"axis_{name}": partial(axis, name) for name in names if name != "nominal" and not COLUMNS[name].sample}
    return {name: write(board) for name, write in writers.items()}
