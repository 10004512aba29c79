"""Plans with smoother and smoother torques on the chain and on the models: how near the default arm is to the chain."""

from __future__ import annotations

from typing import Any

from flexarm_agents.jobs.worker_pool import worker_pool
from flexarm_baselines.optimal.laps import CHANGE_WEIGHT
from flexarm_env import ArmParameters
from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.validation.checks import Check, Findings, Settings
from scripts.validation.plant.drivers import GENTLE, Regulator, on_corner, run_lap
from scripts.validation.plant.study import ELEMENTS, MODELS, distances, row_of

GROUP = "smooth"
CHANGE_WEIGHTS = (CHANGE_WEIGHT, 0.03, 0.1, 0.3, 1.0)  # on changes of the torques [m^2]; first the shipped plans'
SMOOTH = 0.3  # the least of them with which both laps stay within the goal
GOAL = 5.0  # [mm]
WORKERS = 2
CHAIN = "chain"
LENGTH = 16.0  # of a run [s]


def run(settings: Settings) -> Findings:
    """Run all laps, whole ones in the short version, too: the checks are of these."""
    weights = (SMOOTH,) if settings.quick else CHANGE_WEIGHTS
    tasks = [(lap, weight) for weight in weights for lap in LAPS]
    laps: list[dict[str, Any]] = []
    with worker_pool(WORKERS) as pool:
        futures = [pool.submit(_laps_with, *task) for task in tasks]
        for (lap, weight), future in zip(tasks, futures, strict=True):
            settings.progress(f"{lap} lap, changes of the torques weigh {weight:g}")
            laps += future.result()
    return Findings(_checks(laps), {}, {"laps": laps}, _quoted(laps))


def _laps_with(lap: str, weight: float) -> list[dict[str, Any]]:
    """Follow a plan on the chain, on the default arm and on four polynomials: rows of the table."""
    controller = Regulator(ArmParameters(), lap, GENTLE, weight)
    truth = run_lap(controller, on_corner(ArmParameters(), lap, ELEMENTS[-1]), LENGTH)
    own = {model.label: run_lap(controller, on_corner(model.parameters, lap), LENGTH) for model in MODELS[1:]}
    torques = controller.plan.torques
    shared = {"change_weight": weight, "first_torque": float(abs(torques[0, 0]))}
    rows = [row_of(lap, "smooth plan", label, run, truth) for label, run in {CHAIN: truth, **own}.items()]
    return [row | shared for row in rows]


def _found(laps: list[dict[str, Any]], lap: str, weight: float) -> tuple[dict[str, Any], ...]:
    """Return the rows of the chain, the default arm and four polynomials."""
    return tuple(row for row in laps if row["lap"] == lap and row["change_weight"] == weight)


def _checks(laps: list[dict[str, Any]]) -> list[Check]:
    return [
        Check(
            GROUP,
            f"the {lap} lap: the default arm from the chain under a plan with smooth torques, r.m.s.",
            1e3 * _found(laps, lap, SMOOTH)[1]["rms"],
            "a choice: half of the 10 mm that the validity range allows a model",
            "mm",
            most=GOAL,
        )
        for lap in LAPS
    ]


def _quoted(laps: list[dict[str, Any]]) -> dict[str, float]:
    """Return what the docs quote, lengths in mm."""
    names = ("rms", "after_2s", "score")
    return {
        f"{row['lap']}, {row['plant']}, {row['change_weight']:g}, {name}": 1e3 * row[name]
        for row in laps
        for name in names
        if row.get(name) is not None
    }


def tables(findings: Findings) -> dict[str, str]:
    """Return the table of docs/plant.md: a row for each lap and weight."""
    header = (
        "lap",
        "weight on changes of the torques [m^2]",
        "first torque of the shoulder [N m]",
        "score on the default arm, on the chain [mm]",
        "default arm from the chain [mm]: r.m.s. / after 2 s",
        "4 polynomials from the chain [mm]",
    )
    laps = findings.records["laps"]
    rows = []
    for lap in LAPS:
        for weight in dict.fromkeys(row["change_weight"] for row in laps):
            chain, *models = _found(laps, lap, weight)
            away = (distances(row) for row in models)
            scores = f"{1e3 * models[0]['score']:.1f}, {1e3 * chain['score']:.1f}"
            rows.append([lap, f"{weight:g}", f"{chain['first_torque']:.0f}", scores, *away])
    return {"plant_smooth": table(header, rows)}
