"""What the cells of an entry add up to: figures at a point, where an axis breaks it, all as plain values."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from flexarm_agents.board.columns import Column
from flexarm_agents.board.entries import Entry
from flexarm_agents.board.terms import SQUARE, TASKS
from flexarm_agents.environments import settings_of
from flexarm_baselines.optimal.plan import PLANS
from flexarm_env.laps import LAPS
from flexarm_env.metrics import optimality_gap

YARDSTICK = "ifdc"  # of gaps
FIGURES = ("rms", "rms_after_2s", "maximum")
LIMIT = float(settings_of(SQUARE, {}).error_limit or np.inf)  # error at which a lap is lost, and as which it counts [m]
Results = Mapping[str, Sequence[Mapping[str, Any] | None]]  # of each column, of each point


def lap_summary(episodes: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Add up episodes of one kind.

    Returns:
        Their number, how many were lost and when the first of these was [s]; mean, least and largest of each figure of
        those that were complete, None where there is none; and the share of successes, where the task has a goal.
    """
    complete = [one["figures"] for one in episodes if one["figures"] is not None]
    lost = [one["duration"] for one in episodes if one["figures"] is None]
    found: dict[str, Any] = {"episodes": len(episodes), "lost": len(lost), "first_loss": min(lost, default=None)}
    for name in FIGURES:
        values = [figures[name] for figures in complete if figures[name] is not None]
        found[name] = {"mean": float(np.mean(values)), "least": min(values), "most": max(values)} if values else None
    if "success" in episodes[0]:
        found["success"] = sum(one["success"] for one in episodes) / len(episodes)
    return found


def point_summary(result: Mapping[str, Any] | None) -> dict[str, Any] | None:
    """Add up the episodes of a cell, by their laps; "all" where the task has none."""
    if result is None or "not_applicable" in result:
        return None if result is None else dict(result)
    laps: dict[str, list[Mapping[str, Any]]] = {}
    for one in result["episodes"]:
        laps.setdefault(one["lap"] or "all", []).append(one)
    return {lap: lap_summary(episodes) for lap, episodes in laps.items()}


def merged(results: Sequence[Mapping[str, Any] | None]) -> dict[str, Any] | None:
    """Put the parts of a column whose points are one sample together; None if a part is missing."""
    if any(one is None for one in results):
        return None
    known = [one for one in results if one is not None]
    if any("not_applicable" in one for one in known):
        return dict(next(one for one in known if "not_applicable" in one))
    return {"episodes": [episode for one in known for episode in one["episodes"]]}


def counted(laps: Sequence[Mapping[str, Any]]) -> float:
    """Return the mean error of laps of which each lost one counts with `LIMIT` [m]."""
    errors = sum(one["lost"] * LIMIT for one in laps)
    errors += sum((one["episodes"] - one["lost"]) * one["rms"]["mean"] for one in laps if one["rms"] is not None)
    return float(errors / sum(one["episodes"] for one in laps))


def loss(laps: Sequence[Mapping[str, Any]]) -> float:
    """Return the share of laps that were lost; see `counted`."""
    return float(sum(one["lost"] for one in laps) / sum(one["episodes"] for one in laps))


def breaking(column: Column, points: Sequence[Mapping[str, Any] | None]) -> dict[str, dict[str, Any]]:
    """Find where each lap fails first, going away from the nominal value to either side.

    Returns:
        For each lap "lost" and "doubled", each with "low" and "high": the value nearest to the nominal one at which an
        episode is lost, or the mean error over the lap is twice that at the nominal value; None if at none. Where the
        nominal value itself is lost there are no such ends; "complete" then has the values without a loss, else None.
    """
    own = column.nominal_index
    found: dict[str, dict[str, Any]] = {}
    for lap in LAPS:
        laps = [None if one is None else one.get(lap) for one in points]
        usual = _mean(laps[own])
        lost = [n for n, one in enumerate(laps) if one is not None and one["lost"]]
        doubled = [
            n
            for n, one in enumerate(laps)
            if usual is not None and (mean := _mean(one)) is not None and mean > 2.0 * usual
        ]
        complete = None
        if own in lost:
            whole = [n for n, one in enumerate(laps) if one is not None and not one["lost"]]
            lost, doubled, complete = [], [], [column.points[n].value for n in whole]
        ends = {"lost": _ends(column, lost, own), "doubled": _ends(column, doubled, own)}
        found[lap] = {**ends, "complete": complete}
    return found


def spans(values: Sequence[float], some: Sequence[float]) -> str:
    """Write values of an axis, neighbours together: "0.3 to 1"."""
    runs: list[list[float]] = []
    for before, value in zip([None, *values], values, strict=False):
        if value in some:
            if runs and runs[-1][-1] == before:
                runs[-1].append(value)
            else:
                runs.append([value])
    return ", ".join(f"{run[0]:g}" if len(run) == 1 else f"{run[0]:g} to {run[-1]:g}" for run in runs)


def within(values: Sequence[float], ends: Sequence[Mapping[str, float | None]]) -> list[float]:
    """Return the values of an axis that lie within all ends; see `breaking`."""
    low = max((end["low"] for end in ends if end["low"] is not None), default=-np.inf)
    high = min((end["high"] for end in ends if end["high"] is not None), default=np.inf)
    return [value for value in values if low < value < high]


def _mean(lap: Mapping[str, Any] | None) -> float | None:
    """Return the mean error over the complete laps [m]; None where there is none."""
    return None if lap is None or lap["rms"] is None else float(lap["rms"]["mean"])


def _ends(column: Column, failed: Sequence[int], own: int) -> dict[str, Any]:
    """Return the values nearest to the nominal one on either side, among points that failed."""
    low, high = ([n for n in failed if n < own], [n for n in failed if n > own])
    return {
        "low": column.points[max(low)].value if low else None,
        "high": column.points[min(high)].value if high else None,
    }


def entry_summary(entry: Entry, columns: Mapping[str, Column], results: Results) -> dict[str, Any]:
    """Return an entry of the board as plain values."""
    candidate = entry.candidate()
    found: dict[str, Any] = {
        "name": entry.name,
        "source": entry.source,
        "action": candidate.env.unwrapped.settings.action_mode,  # type: ignore[attr-defined]
        "reads": list(candidate.reads),
        "privileged": candidate.privileged,
        "columns": {},
    }
    for name, column in columns.items():
        each = results[name]
        if column.sample:
            whole = point_summary(merged(each))
            found["columns"][name] = {"points": [whole]}
            continue
        points = [point_summary(one) for one in each]
        found["columns"][name] = {"points": points}
        if all(isinstance(point.value, float) for point in column.points):
            found["columns"][name]["breaking"] = breaking(column, points)
    return found


def nominal_errors(entry: Mapping[str, Any]) -> dict[str, dict[str, float] | None]:
    """Return the errors of an entry's nominal laps by name: whole lap and after 2 s [m]; None for a lost one."""
    square = entry["columns"]["nominal"]["points"][list(TASKS).index("square")]
    errors: dict[str, dict[str, float] | None] = {}
    for lap in LAPS:
        one = square[lap] if square else None
        errors[lap] = None if one is None or one["lost"] else {name: one[name]["mean"] for name in FIGURES}
    return errors


def references() -> dict[str, dict[str, float]]:
    """Return the errors of the best plan known for each lap of the default arm [m], which plays an oracle's part."""
    found = {}
    for lap in LAPS:
        score = json.loads((PLANS / f"default_{lap}.json").read_text())["score"]
        found[lap] = {"rms": score["true_tip_rms"], "rms_after_2s": score["true_tip_rms_after_2s"]}
    return found


def gap(results: Mapping[str, Any], lap: str, rms: float) -> float | None:
    """Return where an error lies between the best plan's, 0, and the yardstick's, 1; None without the yardstick."""
    for entry in results["rows"]:
        if entry["name"] == YARDSTICK:
            errors = nominal_errors(entry)[lap]
            if errors is not None:
                return optimality_gap(rms, results["references"][lap]["rms"], errors["rms"])
    return None
