"""The whole reproduction: simulate in worker processes, decide, draw; everything goes through files."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, as_completed
from dataclasses import asdict
from pathlib import Path
from typing import Any

from tqdm import tqdm

from flexarm_agents.jobs.worker_pool import worker_pool
from flexarm_env import Trajectory
from scripts.common.result_files import write_json
from scripts.paper import figures, sweep_figures, tables, verdicts
from scripts.paper.cases import COLUMNS, CONTROLLERS, Case, Study, load_runs, simulate_column
from scripts.paper.checks import PRONOUNCED
from scripts.paper.measures import Workspace, differences, measures
from scripts.paper.numbers import Number, numbers
from scripts.paper.sweeps import SWEEPS, run_sweep

PAPER_CLOCK = {"ifdc": 77.0, "flsac": 100.0}  # [s]; clock time a run, end of section 4
SWEEP_LABELS = {
    "constant_gain": "constant gain lambda",
    "K_s": "output scale K_s",
    "K_n": "normaliser K_n",
    "width_scale": "K_s as width scale of the input sets",
}
TITLES = {name: column.title for name, column in COLUMNS.items()}


def reproduce(study: Study, cases: Sequence[Case], folder: Path, sweeps: bool, pictures: bool, workers: int) -> None:
    """Fill a folder with runs, tables and figures.

    Args:
        study: what it is made with.
        cases: which of the paper's runs.
        folder: an existing empty folder.
        sweeps: make the sweeps too.
        pictures: draw the figures too.
        workers: processes.
    """
    runs_folder, figures_folder = folder / "runs", folder / "figures"
    runs_folder.mkdir()
    figures_folder.mkdir()
    names = list(SWEEPS) if sweeps else []
    with worker_pool(workers) as pool:
        # jobs of different kernels first: the two workers then compile different ones, and the rest find them
        todo = sorted([("sweep", name) for name in names] + [("runs", name) for name in COLUMNS], key=_order)
        jobs: dict[Future[Any], tuple[str, str]] = {}
        for kind, name in todo:
            if kind == "sweep":
                jobs[pool.submit(run_sweep, study, name)] = (kind, name)
            else:
                jobs[pool.submit(simulate_column, study, name, cases, runs_folder)] = (kind, name)
        results = _collect(jobs, "simulating")
        rows = [row for name in names for row in results["sweep", name]]
        clocks = {name: results["runs", name] for name in COLUMNS}
        _decide(study, cases, folder, rows, clocks)
        if pictures:
            drawings = {pool.submit(draw, folder, name): ("figures", name) for name in _drawings(cases, bool(names))}
            _collect(drawings, "drawing")


_FIRST = (("runs", "linear"), ("sweep", "constant_gain"), ("runs", "complete"), ("sweep", "true_tip_feedback"))


def _order(job: tuple[str, str]) -> int:
    return _FIRST.index(job) if job in _FIRST else len(_FIRST)


def _collect(jobs: dict[Future[Any], tuple[str, str]], label: str) -> dict[tuple[str, str], Any]:
    with tqdm(total=len(jobs), desc=label, unit="job") as bar:
        for future in as_completed(jobs):
            bar.set_postfix_str(" ".join(jobs[future]))
            future.result()  # the first failure ends it all
            bar.update()
    return {key: future.result() for future, key in jobs.items()}


def _decide(
    study: Study, cases: Sequence[Case], folder: Path, rows: list[dict[str, Any]], clocks: dict[str, dict[str, float]]
) -> None:
    """Write summary, numbers, claims and sweeps, as JSON and as Markdown."""
    runs = load_runs(folder / "runs")
    found = {
        column: {name: measures(run, study.lap_time) for name, run in named.items()} for column, named in runs.items()
    }
    apart = {column: differences(named, study.lap_time) for column, named in runs.items()}
    for column, named in found.items():
        for name, figures_of_run in named.items():
            paper = PAPER_CLOCK.get(name.split("_")[0])
            if paper is not None:  # the batch's clock time, shared out over its runs
                figures_of_run["clock_time"] = clocks[column]["run"]
                figures_of_run["paper_clock_time_over_ours"] = paper / clocks[column]["run"]
    workspace = {"reach": Workspace().reach, "straight_past_a_corner": Workspace().straight_on}
    write_json(
        folder / "summary.json",
        {"study": asdict(study), "runs": found, "path_differences": apart, "workspace": workspace},
    )
    for column in found:
        (folder / f"summary_{column}.md").write_text(tables.runs(found, column))
    (folder / "reach.md").write_text(tables.reach(found["paper"], Workspace()))
    if rows and "branch" in found:
        rows += [
            {"sweep": "elbow_branch", "arm": "paper", "value": "elbow bent the other way at the start (theta2 < 0)"}
            | asdict(Case(c, "nmp", "tip"))
            | found["branch"][f"{c}_nmp_tip"]
            for c in CONTROLLERS
            if f"{c}_nmp_tip" in found["branch"]
        ]
    _write_numbers(folder, clocks["paper"]["run"])
    if rows:
        write_json(folder / "sweeps.json", rows)
        (folder / "sensitivity.md").write_text(tables.sensitivity(rows))
        for name, label in (SWEEP_LABELS | dict.fromkeys(sweep_figures.TIP_SWEEPS, "constant gain lambda")).items():
            (folder / f"sweep_{name}.md").write_text(tables.sweep(rows, name, label))
    if len(cases) == 12:
        constant = [row for row in rows if row["sweep"] == "constant_gain"]
        decided = verdicts.as_json(verdicts.decide(found, apart, constant, TITLES))
        write_json(folder / "claims.json", decided)
        (folder / "verdicts.md").write_text(tables.verdicts(decided, TITLES))
        (folder / "verdicts_one_side.md").write_text(tables.one_side(decided, TITLES))
        (folder / "elbow_claim.md").write_text(tables.elbow_claim(found, TITLES))
        (folder / "reach_claim.md").write_text(tables.reach_claim(found, Workspace(), PRONOUNCED))
        (folder / "claims.md").write_text(tables.claims(decided, TITLES))


def _write_numbers(folder: Path, clock: float) -> None:
    """Write the paper's numbers beside ours; `clock`: time of one run [s]."""
    clock_rows = [
        Number(
            f"clock time of a run, {c.upper()}",
            "s",
            "end of sec. 4",
            PAPER_CLOCK[c],
            clock,
            "a run's share of the batch of both controllers' runs, measured beside another worker process",
        )
        for c in CONTROLLERS
    ]
    listed = [n.as_json() for n in numbers()]
    write_json(folder / "numbers.json", listed + [n.as_json() for n in clock_rows])
    (folder / "numbers.md").write_text(tables.numbers(listed))


def _drawings(cases: Sequence[Case], sweeps: bool) -> list[str]:
    names = [
        *figures.PATH_FIGURES,
        "fig2",
        "rigid_and_true_tip",
        *(f"time_{case.name}" for case in cases),
    ]
    return names + (
        [f"sweep_{name}" for name in SWEEP_LABELS] + ["alternatives", "true_tip_feedback"] if sweeps else []
    )


def draw(folder: Path, name: str) -> None:
    """Draw one figure from the folder's files."""
    target = folder / "figures"
    lap_time = json.loads((folder / "summary.json").read_text())["study"]["lap_time"]

    def paper_runs(pattern: str = "*") -> dict[str, Trajectory]:
        """Return the runs of the paper's column, by case."""
        files = (folder / "runs").glob(f"paper__{pattern}.npz")
        return {path.stem.split("__")[1]: Trajectory.load(path) for path in sorted(files)}

    if name == "fig2":
        figures.fuzzy_sets(target)
    elif name in figures.PATH_FIGURES:
        controller, place, zoom, title = figures.PATH_FIGURES[name]
        figures.paths(target, name, paper_runs(f"{controller}_*_{place}"), controller, place, zoom, title)
    elif name.startswith("time_"):
        case = name.removeprefix("time_")
        figures.time_histories(target, name, paper_runs(case)[case], lap_time)
    elif name == "rigid_and_true_tip":
        figures.rigid_and_true(target, load_runs(folder / "runs"))
    else:
        _draw_sweep(folder, target, name)


def _draw_sweep(folder: Path, target: Path, name: str) -> None:
    rows = json.loads((folder / "sweeps.json").read_text())
    simple: dict[str, Callable[[Path, Sequence[dict[str, Any]]], None]] = {
        "alternatives": sweep_figures.alternatives,
        "true_tip_feedback": sweep_figures.true_tip_feedback,
    }
    if name in simple:
        simple[name](target, rows)
        return
    sweep = name.removeprefix("sweep_")
    levels = list(_levels(json.loads((folder / "summary.json").read_text())["runs"]["paper"]))
    sweep_figures.sweep_lines(target, rows, sweep, SWEEP_LABELS[sweep], levels)


def _levels(found: dict[str, dict[str, Any]]) -> Iterator[dict[str, Any]]:
    """Yield the paper's two controllers in the NMP case, as levels to compare a sweep with."""
    for controller in CONTROLLERS:
        for place in ("tip", "elbow"):
            run = found.get(f"{controller}_nmp_{place}")
            if run is not None:
                yield run | {"label": f"{controller.upper()}, noncollocated", "place": place}
