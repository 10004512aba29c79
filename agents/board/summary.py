"""What the cells of an entry add up to: figures at a point, where an axis breaks it, all as plain values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from flexarm_agents.board.columns import Column
from flexarm_agents.board.entries import Entry
from flexarm_agents.board.figures import ERRORS, Figure
from flexarm_agents.board.terms import SQUARE, TASKS
from flexarm_agents.environments import settings_of
from flexarm_env.laps import LAPS
from flexarm_env.metrics import optimality_gap

LIMIT = float(settings_of(SQUARE, {}).error_limit or np.inf)  # error at which a lap is lost, and as which it counts [m]
QUANTILES = {"median": 0.5, "p90": 0.9}
CONFIDENCE = 0.95
Results = Mapping[str, Sequence[Mapping[str, Any] | None]]  # of each column, of each point


def lap_summary(episodes: Sequence[Mapping[str, Any]], figures: Mapping[str, Figure] = ERRORS) -> dict[str, Any]:
    """Add up episodes of one kind.

    Returns:
        Their number, how many were lost and when the first of these was [s]; of each figure "median" and "p90", the
        90th percentile, of all episodes, None where it is infinite since a lost one counts so (`quantile`), and "mean",
        "least" and "most" of those that have it, None where none has; and the share of successes, where the task has a
        goal.
    """
    lost = [one["duration"] for one in episodes if one["figures"] is None]
    found: dict[str, Any] = {"episodes": len(episodes), "lost": len(lost), "first_loss": min(lost, default=None)}
    for name in figures:
        each = [None if one["figures"] is None else one["figures"][name] for one in episodes]
        values = [value for value in each if value is not None]
        known = {"mean": float(np.mean(values)), "least": min(values), "most": max(values)} if values else None
        found[name] = known and known | {what: quantile(each, share) for what, share in QUANTILES.items()}
    if "success" in episodes[0]:
        found["success"] = sum(one["success"] for one in episodes) / len(episodes)
    return found


def quantile(values: Sequence[float | None], share: float) -> float | None:
    """Return the least of some values below or at which a share of them lies; None stands for infinity.

    It is one of the values (numpy's "inverted_cdf"): nothing is interpolated between a number and infinity.
    """
    found = np.quantile([np.inf if one is None else one for one in values], share, method="inverted_cdf")
    return float(found) if np.isfinite(found) else None


def loss_interval(lost: int, episodes: int) -> tuple[float, float]:
    """Return the interval of a loss rate with `CONFIDENCE` (Clopper & Pearson, Biometrika 26, 1934)."""
    found = binomtest(lost, episodes).proportion_ci(CONFIDENCE, method="exact")
    return float(found.low), float(found.high)


def point_summary(result: Mapping[str, Any] | None, task: str = "square") -> dict[str, Any] | None:
    """Add up the episodes of a cell, by their laps; "all" where the task has none."""
    if result is None or "not_applicable" in result:
        return None if result is None else dict(result)
    laps: dict[str, list[Mapping[str, Any]]] = {}
    for one in result["episodes"]:
        laps.setdefault(one["lap"] or "all", []).append(one)
    return {lap: lap_summary(episodes, TASKS[task].figures) for lap, episodes in laps.items()}


def sample_summary(results: Sequence[Mapping[str, Any] | None], task: str) -> dict[str, Any]:
    """Add up a column that is one sample: its laps, and "whole", all its episodes."""
    both = merged(results)
    found: dict[str, Any] = {"points": [point_summary(both, task)]}
    if both is not None and "not_applicable" not in both:
        whole = lap_summary(both["episodes"], TASKS[task].figures)
        found["whole"] = whole | {"loss_interval": list(loss_interval(whole["lost"], whole["episodes"]))}
    return found


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
        usual = _mean(laps[own], column)
        lost = [n for n, one in enumerate(laps) if one is not None and one["lost"]]
        doubled = [
            n
            for n, one in enumerate(laps)
            if usual is not None and (mean := _mean(one, column)) is not None and mean > 2.0 * usual
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


def _mean(lap: Mapping[str, Any] | None, column: Column) -> float | None:
    """Return the mean headline figure of the complete laps; None where there is none."""
    name = TASKS[column.points[0].task].headline
    return None if lap is None or lap[name] is None else float(lap[name]["mean"])


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
            found["columns"][name] = sample_summary(each, column.points[0].task)
            continue
        points = [point_summary(one, point.task) for one, point in zip(each, column.points, strict=True)]
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
        errors[lap] = None if one is None or one["lost"] else {name: one[name]["mean"] for name in ERRORS}
    return errors


def gap(results: Mapping[str, Any], lap: str, rms: float) -> float | None:
    """Return where an error lies between the best plan's, 0, and the yardstick's, 1; None without the yardstick."""
    for entry in results["rows"]:
        if entry["name"] == "ifdc":
            errors = nominal_errors(entry)[lap]
            if errors is not None:
                return optimality_gap(rms, results["references"][lap]["rms"], errors["rms"])
    return None
