"""`flexarm evaluate --sweep`: what one row of the board does along one axis, as a table."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

from flexarm_agents.board.columns import COLUMNS, Column, Point
from flexarm_agents.board.episodes import run_points
from flexarm_agents.board.rows import Row
from flexarm_agents.board.summary import breaking, merged, point_summary
from flexarm_agents.commands.progress import Progress
from flexarm_agents.commands.sources import row_of
from flexarm_agents.commands.text import columns
from flexarm_env.laps import LAPS
from flexarm_env.validation import choice

Summary = Mapping[str, Any]


def sweep(given: argparse.Namespace) -> dict[str, Any]:
    """Run the policies along an axis of the board, and print a table for each.

    Returns:
        Plain values for a file.

    Raises:
        ValueError: without a policy, or for an option that the axis sets.
    """
    if not given.policies:
        raise ValueError("policies: nothing to sweep; name one, e.g. --policy ifdc")
    if given.arm is not None or given.laps != 1 or given.seed != 0 or given.own or given.pool:
        raise ValueError("arm, laps, seed, own, pool: the board sets them; they must be left out with --sweep")
    column = COLUMNS[choice("sweep", given.sweep, COLUMNS)]
    written = []
    for source in given.policies:
        row = row_of(source, given, given.options)
        results = _results(row, column.points)
        points = [point_summary(merged(results))] if column.sample else [point_summary(one) for one in results]
        print(_table(row.name, column, points), end="\n\n")
        written.append({"row": row.plain(), "results": results})
    return {"sweep": given.sweep, "rows": written}


def _results(row: Row, points: Sequence[Point]) -> list[dict[str, Any]]:
    """Run a row at some points, one after the other, so that it is seen to go on: the results are the same."""
    found = []
    with Progress(len(points), "points") as tick:
        for point in points:
            found += run_points(row, [point])
            tick()
    return found


def _table(name: str, column: Column, points: Sequence[Summary | None]) -> str:
    """Write a line for each point: the laps' errors, or when and how often they were lost."""
    unit = f" [{column.unit}]" if column.unit else ""
    values = ["all"] if column.sample else [_number(one.value) for one in column.points]
    header = (f"{name}: {column.title.lower()}{unit}", *(f"{lap} lap [m]" for lap in LAPS), "after 2 s [m]", "")
    rows = [(value, *_cells(point)) for value, point in zip(values, points, strict=True)]
    lines = columns([header, *rows], right=True)
    if all(isinstance(point.value, float) for point in column.points):
        lines += "".join(f"\n{lap} lap: {fails(ends)}" for lap, ends in breaking(column, points).items())
    return lines


def fails(ends: Mapping[str, Mapping[str, Any]]) -> str:
    """Say where a lap's error is doubled first, and where it is lost."""
    told = []
    for what, words in (("doubled", "error doubled"), ("lost", "lost")):
        sides = (("low", "{} and below"), ("high", "{} and above"))
        where = [side.format(_number(ends[what][end])) for end, side in sides if ends[what][end] is not None]
        told.append(f"{words} at {', '.join(where)}" if where else f"never {words}")
    return "; ".join(told)


def _number(value: float | str) -> str:
    return f"{value:g}" if isinstance(value, float) else value


def _cells(point: Summary | None) -> tuple[str, ...]:
    if point is None or "not_applicable" in point:
        return "-", "-", "-", "" if point is None else f"not applicable: {point['not_applicable']}"
    laps = [point.get(lap, point.get("all")) for lap in LAPS]
    later = " / ".join("-" if one["rms_after_2s"] is None else f"{one['rms_after_2s']['mean']:.3f}" for one in laps)
    return *("-" if one["rms"] is None else f"{one['rms']['mean']:.3f}" for one in laps), later, _lost(point)


def _lost(point: Summary) -> str:
    """Say how many episodes of which lap were lost, and when the first of them."""
    return ", ".join(
        f"{lap}: {one['lost']} of {one['episodes']} lost, first at {one['first_loss']:.2f} s"
        for lap, one in point.items()
        if one["lost"]
    )
