"""What the cells of an entry add up to: figures at a point, values of an axis without a loss, all as plain values."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.stats import binomtest

from flexarm_agents.board.columns import COLUMNS, Column
from flexarm_agents.board.entries import Entry
from flexarm_agents.board.figures import ERRORS, Figure
from flexarm_agents.board.terms import TASKS
from flexarm_env.envs.settings import Settings
from flexarm_env.laps import LAPS

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


def point_summaries(column: Column, results: Sequence[Mapping[str, Any] | None]) -> list[dict[str, Any] | None]:
    """Add up the episodes of each point of a column; where the points are one sample, of all together."""
    if column.sample:
        return [point_summary(merged(results), column.points[0].task)]
    return [point_summary(one, point.task) for one, point in zip(results, column.points, strict=True)]


def whole_summary(column: Column, results: Sequence[Mapping[str, Any] | None]) -> dict[str, Any] | None:
    """Add up all episodes of a column; None if a point is missing, none is applicable, or the tasks' figures differ."""
    figures = TASKS[column.points[0].task].figures
    if any(one is None for one in results) or any(TASKS[point.task].figures != figures for point in column.points):
        return None
    episodes = [episode for one in results if one for episode in one.get("episodes", ())]
    if not episodes:
        return None
    whole = lap_summary(episodes, figures)
    return whole | {"loss_interval": list(loss_interval(whole["lost"], whole["episodes"]))}


def merged(results: Sequence[Mapping[str, Any] | None]) -> dict[str, Any] | None:
    """Put the parts of a column whose points are one sample together; None if a part is missing."""
    if any(one is None for one in results):
        return None
    known = [one for one in results if one is not None]
    if any("not_applicable" in one for one in known):
        return dict(next(one for one in known if "not_applicable" in one))
    return {"episodes": [episode for one in known for episode in one["episodes"]]}


def loss(laps: Sequence[Mapping[str, Any]]) -> float:
    """Return the share of laps that were lost."""
    return float(sum(one["lost"] for one in laps) / sum(one["episodes"] for one in laps))


def kept(column: Column, points: Sequence[Mapping[str, Any] | None]) -> list[float]:
    """Return the values of an axis about the nominal one, up to but without the first on either side that loses a lap.

    Where the column has a `bound`, the mean error of each lap is at most that, too.
    """
    bound = np.inf if column.bound is None else column.bound
    able = [one if one and "not_applicable" not in one else None for one in points]
    whole = [
        one is not None
        and not any(lap["lost"] or (lap["rms"] or {"mean": np.inf})["mean"] > bound for lap in one.values())
        for one in able
    ]
    own = column.nominal_index
    first = next((n + 1 for n in range(own, -1, -1) if not whole[n]), 0)
    last = next((n for n in range(own, len(points)) if not whole[n]), len(points))
    return [float(column.points[n].value) for n in range(first, last)]


def value_text(value: float | str) -> str:
    """Write a value of an axis."""
    return f"{value:g}" if isinstance(value, float) else value


def spans(values: Sequence[float]) -> str:
    """Write values of an axis that are neighbours: "0.3 to 1"."""
    return f"{values[0]:g} to {values[-1]:g}" if len(values) > 1 else "".join(f"{value:g}" for value in values)


def entry_summary(entry: Entry, columns: Mapping[str, Column], results: Results) -> dict[str, Any]:
    """Return an entry of the board as plain values."""
    candidate = entry.candidate()
    settings: Settings = candidate.env.unwrapped.settings  # type: ignore[attr-defined]
    found: dict[str, Any] = {
        "name": entry.name,
        "source": entry.source,
        "action": settings.action_mode,
        "torque_limit": list(settings.motor_limit) if np.isfinite(settings.motor_limit).all() else None,
        "reads": list(candidate.reads),
        "privileged": candidate.privileged,
        "columns": {},
    }
    for name, column in columns.items():
        each = results[name]
        points = point_summaries(column, each)
        found["columns"][name] = {"points": points}
        if whole := whole_summary(column, each):
            found["columns"][name]["whole"] = whole
        if all(isinstance(point.value, float) for point in column.points):
            found["columns"][name]["kept"] = kept(column, points)
    return found


def nominal_errors(entry: Mapping[str, Any]) -> dict[str, dict[str, float] | None]:
    """Return the errors of an entry's nominal laps by name: whole lap and after 2 s [m]; None for a lost one."""
    points = entry["columns"].get("nominal", {"points": [None]})["points"]
    square = points[[point.task for point in COLUMNS["nominal"].points].index("square")]
    errors: dict[str, dict[str, float] | None] = {}
    for lap in LAPS:
        one = square.get(lap) if square else None
        errors[lap] = None if one is None or one["lost"] else {name: one[name]["mean"] for name in ERRORS}
    return errors
