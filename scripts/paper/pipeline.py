"""The whole reproduction: simulate in worker processes, decide, tabulate, draw; pictures are drawn from files."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from scripts.common.plotting import save
from scripts.common.result_files import write_json
from scripts.common.study import Trial, run_all
from scripts.paper import figures, sweep_figures, tables, verdicts
from scripts.paper.cases import COLUMNS, CONTROLLERS, PLACES, Case, Study, load_runs, simulate_column
from scripts.paper.measures import REACH, STRAIGHT_ON, differences, measures
from scripts.paper.numbers import PAPER_CLOCK, clock_numbers, numbers
from scripts.paper.sweeps import SWEEPS, run_sweep

# Jobs of different kernels first: two workers then compile different ones, and the rest find them.
_FIRST = ("runs linear", "sweep constant_gain", "runs complete", "sweep true_tip_feedback")


def reproduce(study: Study, cases: Sequence[Case], folder: Path, sweeps: bool, pictures: bool, workers: int) -> None:
    """Fill a folder with runs, tables and figures."""
    (folder / "runs").mkdir()
    (folder / "figures").mkdir()
    swept = list(SWEEPS) if sweeps else []
    jobs: dict[str, Trial] = {f"sweep {name}": partial(run_sweep, study, name) for name in swept}
    jobs |= {f"runs {name}": partial(simulate_column, study, name, cases, folder / "runs") for name in COLUMNS}
    first = {name: jobs[name] for name in _FIRST if name in jobs}
    found = dict(run_all(first | jobs, workers, "simulating"))
    rows = [row for name in swept for row in found[f"sweep {name}"]]
    _decide(study, folder, rows, {name: found[f"runs {name}"]["run"] for name in COLUMNS}, len(cases) == 12)
    if pictures:
        drawings = {name: partial(draw, folder, name) for name in _drawings(cases, sweeps)}
        list(run_all(drawings, workers, "drawing"))


def _decide(study: Study, folder: Path, rows: list[dict[str, Any]], clocks: Mapping[str, float], whole: bool) -> None:
    """Write summary, numbers, claims and sweeps, as JSON and as Markdown.

    `rows` are those of the sweeps, `clocks` the time of one run of each column [s]. The claims need the `whole` of the
    twelve cases.
    """
    found: dict[str, dict[str, dict[str, Any]]] = {}
    apart = {}
    for column, named in load_runs(folder / "runs").items():
        found[column] = {name: measures(run, study.lap_time) for name, run in named.items()}
        apart[column] = differences(named, study.lap_time)
        for name, own in found[column].items():
            paper = PAPER_CLOCK.get(name.split("_")[0])
            if paper is not None:  # the batch's clock time, shared out over its runs
                own["clock_time"], own["paper_clock_time_over_ours"] = clocks[column], paper / clocks[column]
    workspace = {"reach": REACH, "straight_past_a_corner": STRAIGHT_ON}
    data: dict[str, Any] = {
        "summary": {"study": asdict(study), "runs": found, "path_differences": apart, "workspace": workspace},
        "numbers": [one.as_json() for one in (*numbers(), *clock_numbers(clocks["paper"]))],
    }
    if rows:
        data["sweeps"] = rows = rows + _other_branch(found["branch"])
    if whole:
        constant = [row for row in rows if row["sweep"] == "constant_gain"]
        data["claims"] = verdicts.decide(found, apart, constant)
    for name, one in data.items():
        write_json(folder / f"{name}.json", one)
    for name, text in tables.everything(found, rows, data.get("claims", [])).items():
        (folder / f"{name}.md").write_text(text)


def _other_branch(found: Mapping[str, dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the runs whose elbow is bent the other way, as rows of a sweep."""
    head = {"sweep": "elbow_branch", "arm": "paper", "value": "elbow bent the other way at the start (theta2 < 0)"}
    cases = [case for case in (Case(controller, "nmp", "tip") for controller in CONTROLLERS) if case.name in found]
    return [head | asdict(case) | found[case.name] for case in cases]


def _drawings(cases: Sequence[Case], sweeps: bool) -> list[str]:
    """Return the names of the figures that can be drawn."""
    drawn = {(case.controller, case.place) for case in cases}
    paths = [name for name, (controller, place, *_) in figures.PATH_FIGURES.items() if (controller, place) in drawn]
    names = [*paths, "fig2", "rigid_and_true_tip", *(f"time_{case.name}" for case in cases)]
    swept = [*(f"sweep_{name}" for name in tables.SWEEP_LABELS), *sweep_figures.OTHERS]
    return names + (swept if sweeps else [])


def draw(folder: Path, name: str) -> None:
    """Draw one figure from the folder's files."""
    save(_drawn(folder, name), folder / "figures", name)


def _drawn(folder: Path, name: str) -> Figure:
    if name == "fig2":
        return figures.fuzzy_sets()
    if name in figures.PATH_FIGURES:
        controller, place, zoom, title = figures.PATH_FIGURES[name]
        runs = load_runs(folder / "runs", f"paper__{controller}_*_{place}")["paper"]
        return figures.paths(runs, controller, place, zoom, title)
    summary = json.loads((folder / "summary.json").read_text())
    if name.startswith("time_"):
        case = name.removeprefix("time_")
        run = load_runs(folder / "runs", f"paper__{case}")["paper"][case]
        return figures.time_histories(run, summary["study"]["lap_time"])
    if name == "rigid_and_true_tip":
        return figures.rigid_and_true(load_runs(folder / "runs"))
    rows = json.loads((folder / "sweeps.json").read_text())
    if name in sweep_figures.OTHERS:
        return sweep_figures.OTHERS[name](rows)
    sweep, paper = name.removeprefix("sweep_"), summary["runs"]["paper"]
    levels = [
        paper[case] | {"label": f"{controller.upper()}, noncollocated", "place": place}
        for controller in CONTROLLERS
        for place in PLACES
        if (case := f"{controller}_nmp_{place}") in paper
    ]
    return sweep_figures.sweep_lines(rows, sweep, tables.SWEEP_LABELS[sweep], levels)
