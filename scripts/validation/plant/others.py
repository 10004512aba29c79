"""Further controllers on the chain and on the models, and what the start of a lap consists of."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from flexarm_agents.board.rows import Row
from flexarm_agents.jobs.worker_pool import worker_pool
from flexarm_env import ArmParameters
from flexarm_env.laps import LAPS
from flexarm_env.metrics import summary
from flexarm_env.rollout import run_policy
from scripts.common.markdown import table
from scripts.validation.checks import Check, Findings, Settings
from scripts.validation.engine.motion import rms
from scripts.validation.plant.drivers import PERIODS, WEIGHTS, Hosted, Regulator, on_corner, run_lap
from scripts.validation.plant.study import ELEMENTS, MODELS, distances, find_row, row_of

Array = NDArray[np.float64]
GROUP = "controllers"
# Controllers of the board within 60 mm on the swing lap that read sensors, by their names there; the group "plant" has
# another one, the student of unknown arms.
OTHERS = ("lqg_adaptive", "nmpc", "lqg", "student", "lqg_gauges", "student_gauges")
WORKERS = 2
START = 0.5  # [s]; the torques of so long are also applied open loop, and parts of them
SHARES = (1.0, 0.5, 0.25, 0.125)
CHATTERS = "student"  # the controller of which scores are also taken on chains with finer steps
CHAIN_STEPS = (5e-4, 1e-4, 2e-5)  # [s], the first one the environment's own
CHAIN, FINER = (f"chain, {n} elements" for n in (ELEMENTS[-1], 2 * ELEMENTS[-1]))
DEFAULT, FOUR = (model.label for model in MODELS[1:])


def run(settings: Settings) -> Findings:
    """Run all laps."""
    quick = settings.quick
    seconds = 0.5 if quick else 16.0
    names = OTHERS[3:4] if quick else OTHERS
    start = at_the_start(0.1 if quick else START, settings.progress)
    laps, arrays = under_others(names, seconds, settings.progress)
    records = {"start": start, "laps": laps, "steps": by_step(CHAIN_STEPS[:1] if quick else CHAIN_STEPS)}
    return Findings(_checks(records), arrays, records, _quoted(records))


def _checks(records: dict[str, Any]) -> list[Check]:
    finer = [row["rms"] for row in records["start"] if row["plant"] == FINER and row["share"] == 1.0]
    nearest = min(row["rms"] for row in records["laps"] if row["plant"] == DEFAULT and row["lap"] == "plain")
    return [
        Check(
            GROUP,
            "starts of both laps: twice the elements from the chain, r.m.s.",
            1e3 * max(finer),
            "a choice: a tenth of the 5 mm that the default arm is allowed",
            "mm",
            most=0.5,
        ),
        Check(
            GROUP,
            "the plain lap: the default arm from the chain under the controller that does best, r.m.s.",
            1e3 * nearest,
            "a choice: half of the 10 mm that the validity range allows a model",
            "mm",
            most=5.0,
        ),
    ]


def under_others(
    names: Sequence[str], seconds: float, progress: Callable[[str], None]
) -> tuple[list[dict[str, Any]], dict[str, Array]]:
    """Run further controllers on the finer chain and on the models that compete to be the default.

    Args:
        names: of them, in `OTHERS`.
        seconds: length of a run [s].
        progress: called with a word on what is done.

    Returns:
        Rows of the table, and how far the default arm's tip is from the chain's every control period [m].
    """
    tasks = [(lap, name, seconds) for name in names for lap in LAPS]
    rows, arrays = [], {}
    with worker_pool(WORKERS) as pool:
        futures = [pool.submit(_laps_of, *task) for task in tasks]
        for (lap, name, _), future in zip(tasks, futures, strict=True):
            progress(f"{lap} lap, {name}")
            found, arrays[f"{lap}, {name}"] = future.result()
            rows += found
    return rows, arrays


def _laps_of(lap: str, name: str, seconds: float) -> tuple[list[dict[str, Any]], Array]:
    """Run a controller on chain and models: rows of the table, and the default arm's distance from the chain [m]."""
    controller = Hosted(name, lap)
    truth = run_lap(controller, on_corner(ArmParameters(), lap, ELEMENTS[-1]), seconds)
    laps = {model.label: run_lap(controller, on_corner(model.parameters, lap), seconds) for model in MODELS[1:]}
    rows = [row_of(lap, name, plant, own, truth) for plant, own in {CHAIN: truth, **laps}.items()]
    return rows, np.linalg.norm(laps[DEFAULT].tip - truth.tip, axis=1)[::PERIODS]


def at_the_start(seconds: float, progress: Callable[[str], None]) -> list[dict[str, Any]]:
    """Apply shares of a lap's first torques to the chain and to models, open loop, from rest.

    What the shapes cannot follow is linear in the torques, and its share stays as they become less; what the kinematics
    leave out of the bent links' geometry goes faster than they do.

    Args:
        seconds: of the lap that are applied, `START` at most.
        progress: called with a word on what is done.

    Returns:
        Rows of the table: distances from the finer chain over the share [m].
    """
    rows = []
    models = {model.label: (model.parameters, None) for model in MODELS}
    chains = {f"chain, {n} elements": (ArmParameters(), n) for n in (ELEMENTS[-1], 2 * ELEMENTS[-1])}
    for lap in LAPS:
        progress(f"{lap} lap, its start")
        gentle = Regulator(ArmParameters(), lap, next(iter(WEIGHTS.values())))
        torques = run_lap(gentle, on_corner(ArmParameters(), lap, ELEMENTS[-1]), min(seconds, START)).torque
        for share in SHARES:
            tips, bend = {}, 0.0
            for label, (parameters, elements) in (chains | models).items():
                plant = on_corner(parameters, lap, elements)
                parts = []
                for torque in torques:
                    parts.append(plant.advance(share * torque, PERIODS))
                    if elements == ELEMENTS[-1]:
                        bend = max(bend, float(np.abs(plant.look().deflection).max()))
                tips[label] = np.concatenate(parts)
            truth, *others = tips
            for label in others:
                away = np.linalg.norm(tips[label] - tips[truth], axis=1) / share
                row = {"lap": lap, "share": share, "plant": label, "bend": bend}
                rows.append(row | {"rms": rms(away), "maximum": float(away.max())})
    return rows


def by_step(steps: Sequence[float]) -> list[dict[str, Any]]:
    """Run a controller whose torques chatter on `FlexArm/SquareChain-v0` with several integration steps.

    Args:
        steps: of the chain [s].

    Returns:
        A row for each: the step, and r.m.s. distances over each lap [m], None of one that ended early.
    """
    row, rows = Row(CHATTERS), []
    for step in steps:
        env = gymnasium.make("FlexArm/SquareChain-v0", **row.interface, chain_step=step)
        scores = {lap: summary(run_policy(env, row.candidate().policy, lap=lap)).get("true_tip_rms") for lap in LAPS}
        rows.append({"step": step, **scores})
        env.close()
    return rows


def _quoted(records: dict[str, Any]) -> dict[str, float]:
    """Return what the docs quote, lengths in mm."""
    quoted: dict[str, float] = {}
    for row in records["laps"]:
        which = f"{row['lap']}, {row['controller']}, {row['plant']}"
        quoted |= {
            f"{which}, {name}": 1e3 * row[name] for name in ("rms", "after_2s", "score") if row.get(name) is not None
        }
    for row in records["steps"]:
        quoted |= {f"{lap}, {CHATTERS}, {row['step']:g} s": 1e3 * row[lap] for lap in LAPS if row[lap] is not None}
    for row in records["start"]:
        quoted[f"{row['lap']}, start, {row['plant']}, share {row['share']:g}, rms"] = 1e3 * row["rms"]
        quoted[f"{row['lap']}, start, share {row['share']:g}, bend"] = 1e3 * row["bend"]
    return quoted


# --- tables -----------------------------------------------------------------------------------------------------------


def tables(findings: Findings) -> dict[str, str]:
    """Return the tables of docs/plant.md."""
    return {"plant_others": _laps_table(findings.records), "plant_start": _start_table(findings.records)}


def _laps_table(records: Mapping[str, Any]) -> str:
    """Return a row for each controller and lap, those nearest to the chain first."""
    header = (
        "lap",
        "controller",
        "default arm from the chain [mm]: r.m.s. / after 2 s",
        "4 polynomials from the chain [mm]",
        "score on the default arm, on the chain [mm]",
        "torque change there, r.m.s. [N m]",
    )
    rows = []
    for lap in LAPS:
        every = [row for row in records["laps"] if row["lap"] == lap]
        for own in sorted((row for row in every if row["plant"] == DEFAULT), key=lambda row: row["rms"]):
            four, chain = (find_row(every, controller=own["controller"], plant=plant) for plant in (FOUR, CHAIN))
            scores = ", ".join("lost" if row["lost"] else f"{1e3 * row['score']:.1f}" for row in (own, chain))
            changes = f"{own['torque_change']:.3g}, {chain['torque_change']:.3g}"
            away = ["" if chain["lost"] else distances(row) for row in (own, four)]
            rows.append([lap, f"`{own['controller']}`", *away, scores, changes])
    return table(header, rows)


def _start_table(records: Mapping[str, Any]) -> str:
    rows = []
    plants = list(dict.fromkeys(row["plant"] for row in records["start"]))
    for lap in LAPS:
        for share in SHARES:
            own = [row for row in records["start"] if row["lap"] == lap and row["share"] == share]
            aways = [f"{1e3 * find_row(own, plant=name)['rms']:.3g}" for name in plants]
            rows.append([lap, f"{share:g}", f"{own[0]['bend']:.2f}", *aways])
    return table(["lap", "share of the torques", "largest deflection [m]", *plants], rows)
