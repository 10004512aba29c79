"""What the board says of agents: measured for every training, and published for rows beside them."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from flexarm_agents import Spread
from flexarm_agents.board.cells import Cell, Store, compute, jobs_of
from flexarm_agents.board.columns import COLUMNS, Point
from flexarm_agents.board.entries import Entry
from flexarm_agents.board.figures import ERRORS
from flexarm_agents.board.measure import PUBLISHED
from flexarm_agents.board.summary import QUANTILES, merged, point_summary
from flexarm_agents.board.tables import UNKNOWN, unknown_cells
from flexarm_agents.board.terms import TASKS
from flexarm_agents.policies.load import POLICIES, load_policy
from flexarm_env.laps import LAPS
from scripts.common.markdown import millimetres, spread_text, table
from scripts.shipped.agents import AGENTS

Figures = Mapping[str, Any]  # by `TASKS` of the board and "unknown", then by lap
Card = Mapping[str, Any]  # of a shipped agent
MEASURED: dict[str, tuple[Point, ...]] = {
    **{str(point.value): (point,) for point in COLUMNS["nominal"].points if point.value in ("square", "chain")},
    "unknown": COLUMNS["unknown"].points,
}
DRAWN = 64  # episodes of a lap on a task of its own, where each is drawn
# Controllers that know the model, where the board has them; the first sees the true state, too.
CONTROLLERS = {"plan_lqr": "true state, best plan (`plan_lqr`)", "lqg": "`lqg`", "lqg_adaptive": "`lqg_adaptive`"}


def cards() -> dict[str, Card]:
    """Read the cards of all shipped agents."""
    return {name: json.loads((POLICIES / f"{name}.json").read_text()) for name in AGENTS}


def measured(source: Path, cells: Store) -> dict[str, Any]:
    """Run the best policy of a training, or a policy's file, on the nominal laps, on the chain and on unknown arms.

    Return `point_summary` of each of `MEASURED`; on the nominal laps with the change of the torques [N m].
    """
    row, found = Entry(str(source)), {}
    for name, points in (MEASURED if row.home == "square" else own_points(row.home)).items():
        whole = merged(_results([Cell.of(row, point) for point in points], cells))
        summary = point_summary(whole, points[0].task)
        assert whole is not None
        assert summary is not None
        if name == "square":
            for one in whole["episodes"]:
                summary[one["lap"]]["torque_change"] = one["figures"] and one["figures"]["torque_change_after_2s"]
        found[name] = summary
    return found


def own_points(task: str) -> dict[str, tuple[Point, ...]]:
    """Return the points of the board's column of a task, by their names; drawn ones with `DRAWN` episodes a lap."""
    points = (replace(one, seeds=range(DRAWN if len(one.seeds) > 1 else 1)) for one in COLUMNS[task].points)
    return {str(one.value): (one,) for one in points if one.task == task}


def own_tasks(cards: Mapping[str, Card]) -> str:
    """Tabulate the agents of tasks of their own on these; the shipped training of each."""
    lines = []
    for name, card in cards.items():
        (own,) = (one for one in card["trainings"] if one["seed"] == card["config"]["seed"])
        task = Entry(name).home
        for point, laps in own["board"].items() if task != "square" else ():
            for lap, found in laps.items():
                figures = {one: about.unit for one, about in TASKS[task].figures.items() if one not in ERRORS}
                cells = ("; ".join(_told(found[one], what, figures[one]) for one in figures) for what in QUANTILES)
                names = "; ".join(figures).replace("_", " ")
                lines.append((f"`{name}`", point, lap, f"{found['lost']} of {found['episodes']}", names, *cells))
    return table(("agent", "on", "lap", "lost", "figures", "median", "90th percentile"), lines)


def _told(figure: Mapping[str, float | None] | None, what: str, unit: str) -> str:
    value = None if figure is None else figure[what]
    return "-" if value is None else f"{1e3 * value:.2f} mm" if unit == "m" else f"{value:.4g} {unit}"


def _results(cells: Sequence[Cell], store: Store) -> list[dict[str, Any] | None]:
    """Return the results of cells in their order; those that the store lacks are computed and put there."""
    for job in jobs_of(store.missing(cells)):
        for cell, result in zip(job, compute(job), strict=True):
            store.write(cell, result)
    return [store.read(cell) for cell in cells]


def published() -> tuple[Mapping[str, Figures], Mapping[str, Mapping[str, float]]]:
    """Return what `measured` gives of each row of the published board, and the errors of the best plans known.

    A row has its `unknown_cells`, too, as "cells".
    """
    board = json.loads(PUBLISHED.read_text())
    tasks = board["columns"]["nominal"]["values"]
    rows = {
        row["name"]: dict(zip(tasks, row["columns"]["nominal"]["points"], strict=True))
        | {"unknown": row["columns"]["unknown"]["points"][0], "cells": unknown_cells(row)}
        for row in board["rows"]
    }
    return rows, board["tasks"]["square"]["best"]


def compared(cards: Mapping[str, Card]) -> Iterator[tuple[str, list[Figures]]]:
    """Yield controllers and agents of the board's arm with figures, an agent's for each training that was measured."""
    rows, _ = published()
    for name, text in CONTROLLERS.items():
        if name in rows:
            yield text, [rows[name]]
    for name, card in cards.items():
        if load_policy(name).has_own_arm or load_policy(name).has_own_task:
            continue  # the board is of the default one, these laps are the square's
        yield f"agent `{name}`", [one["board"] for one in card["trainings"]]


def nominal(cards: Mapping[str, Card]) -> str:
    """Tabulate the nominal laps, by the best plans known."""
    _, plans = published()
    lines = []
    for text, several in compared(cards):
        laps = {lap: [one["square"][lap] for one in several] for lap in LAPS}
        cells: list[str] = []
        for lap, found in laps.items():
            errors, later = ([_of(one, figure, "mean") for one in found] for figure in ("rms", "rms_after_2s"))
            median = Spread.of(errors).median
            times = "-" if median is None else f"{median / plans[lap]['rms']:.2f}"
            cells += [_errors(errors, 1), times, _errors(later, 1)]
        pairs = [one.get("torque_change") for found in laps.values() for one in found]
        change = "-" if None in pairs else f"{max(max(pair) for pair in pairs if pair is not None):.1f}"
        lines.append((text, str(len(several)), *cells, change))
    heads = [f"{lap}: {what}" for lap in LAPS for what in ("lap [mm]", "times the plan", "after 2 s [mm]")]
    return table(("", "seeds", *heads, "torque change, most [N m]"), lines)


def unknown(cards: Mapping[str, Card]) -> str:
    """Tabulate unknown arms, and the chain beside the nominal laps."""
    lines, rows = [], published()[0]
    for text, several in compared(cards):
        unknown = [one["unknown"] for one in several]
        lost = Spread.of(float(sum(lap["lost"] for lap in one.values())) for one in unknown)
        entry = rows.get(text.replace("`", ""), several[0])  # an agent's as it is shipped
        shown = entry.get("cells", ["-"] * len(UNKNOWN))[1:]
        both = _errors([_mean([_of(lap, "rms", "mean") for lap in one.values()]) for one in unknown])
        most = ([error for lap in one.values() if (error := _of(lap, "rms", "most")) is not None] for one in unknown)
        worst = _errors([max(errors, default=None) for errors in most])
        times = [spread_text(Spread.of(_times(one, lap) for one in several), 2) for lap in LAPS]
        lines.append((text, str(len(several)), spread_text(lost, 0), *shown, both, worst, *times))
    episodes = sum(len(point.episodes) for point in MEASURED["unknown"])
    errors = [*UNKNOWN[1:], "mean of the completed laps [mm]", "worst completed [mm]"]
    chain_heads = [f"chain, times the nominal {lap} lap" for lap in LAPS]
    return table(("", "seeds", f"lost of {episodes}", *errors, *chain_heads), lines)


def _of(lap: Mapping[str, Any], figure: str, what: str) -> float | None:
    """Return a figure of a summary; None where no lap was complete."""
    return None if lap[figure] is None else float(lap[figure][what])


def _times(figures: Figures, lap: str) -> float | None:
    """Return how many times the nominal error a lap on the chain has."""
    if "not_applicable" in figures["chain"]:
        return None
    chain, own = (_of(figures[task][lap], "rms", "mean") for task in ("chain", "square"))
    return None if chain is None or own is None or figures["chain"][lap]["lost"] else chain / own


def _mean(values: list[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if len(known) == len(values) else None


def _errors(values: list[float | None], digits: int = 0) -> str:
    return millimetres(Spread.of(values), digits)
