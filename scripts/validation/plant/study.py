"""Laps under several controllers on arms of several shapes and on the chain, and how far they are apart."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env import ArmParameters, FlexibleArm, SquareParameters, square
from flexarm_env.laps import LAPS, SETTLED
from scripts.validation.engine.chain import Modal
from scripts.validation.engine.motion import rms
from scripts.validation.engine.programmes import HELD
from scripts.validation.engine.square import laws_on_chain, laws_on_model
from scripts.validation.plant.drivers import PERIODS, WEIGHTS, Controller, Hosted, Lap, Regulator, on_corner, run_lap

Array = NDArray[np.float64]
STUDENT = "student of unknown arms"
AGENTS = {"PPO agent": "square", STUDENT: "student_unknown"}  # shipped policies, by their names in the tables
AHEAD, EVERY = 0.5, 0.25  # a prediction's length, and how often one starts [s]
ERROR_LIMIT = 2.5  # [m], that of the environments
ELEMENTS = (10, 20)  # of the chains; their difference is the finer one's error, times three
# From 8 s on, IFDC's undamped arm is through the straight pose, where millimetres decide which way the elbow goes.
LAW_SECONDS = {"ifdc": 7.9, "flsac": 16.0}


class Model(NamedTuple):
    """An arm of so many polynomials with foreshortened kinematics, or the linear arm.

    Attributes:
        label: for tables.
        parameters: of the arm, damped as the default one.
    """

    label: str
    parameters: ArmParameters


def polynomials(count: int, **changes: Any) -> Model:
    """Return the default arm with so many polynomials a link."""
    return Model(f"{count} polynomials", ArmParameters(modes_per_link=count, **changes))


MODELS = tuple(polynomials(count) for count in (2, 3, 4))
FORMER = Model("linear, 2 modes", ArmParameters.linear())


def controllers(lap: str) -> dict[str, Controller]:
    """Return the controllers of a lap by their names in the tables."""
    regulators = {
        f"plan with {name} feedback": Regulator(ArmParameters(), lap, weights) for name, weights in WEIGHTS.items()
    }
    agents = {name: Hosted(policy, lap) for name, policy in AGENTS.items()}
    return {**agents, **regulators}


def under_control(
    seconds: Callable[[str, str], float], progress: Callable[[str], None]
) -> tuple[list[dict[str, Any]], dict[str, Array]]:
    """Run all controllers on chains and models.

    Args:
        seconds: returns the length of the runs of a lap and a controller [s].
        progress: called with a word on what is done.

    Returns:
        Rows of the tables, and tips [m] every control period by their labels.
    """
    rows, arrays = [], {}
    for lap in LAPS:
        for name, controller in controllers(lap).items():
            chains, length = [], seconds(lap, name)
            for elements in ELEMENTS:
                progress(f"{lap} lap, {name}, chain of {elements} elements")
                models = [FlexibleArm(model.parameters) for model in MODELS] if elements == ELEMENTS[-1] else []
                chains.append(run_lap(controller, on_corner(ArmParameters(), lap, elements), length, models))
            coarse, fine = chains
            rows.append(row_of(lap, name, f"chain, {ELEMENTS[0]} elements", coarse, fine))
            rows.append(row_of(lap, name, f"chain, {ELEMENTS[1]} elements", fine, fine))
            arrays[f"{lap}, {name}, chain"] = fine.tip[::PERIODS]
            ahead = dict(zip(MODELS, fine.states, strict=True))
            for model in (*MODELS, FORMER):
                progress(f"{lap} lap, {name}, {model.label}")
                own = run_lap(controller, on_corner(model.parameters, lap), length)
                row = row_of(lap, name, model.label, own, fine)
                if model in ahead:
                    row["ahead"] = half_a_second_ahead(FlexibleArm(model.parameters), ahead[model], fine)
                rows.append(row)
                arrays[f"{lap}, {name}, {model.label}"] = own.tip[::PERIODS]
    return rows, arrays


def under_the_laws(seconds: Mapping[str, float], progress: Callable[[str], None]) -> list[dict[str, Any]]:
    """Run the paper's laws on undamped chains and models; the distance is from the extrapolated chain."""
    progress("the laws on the chain")
    coarse, fine = (laws_on_chain(n, dict(seconds)) for n in ELEMENTS)
    truth = {law: fine[law] + (fine[law] - coarse[law]) / 3.0 for law in seconds}  # of second order in 1 / elements
    rows = []
    models = [polynomials(count, damping_ratio=0.0) for count in (2, 3, 4)]
    for model in (*models, Model(FORMER.label, ArmParameters.linear(damping_ratio=0.0))):
        progress(f"the laws on {model.label}")
        tips = laws_on_model(model.parameters, max(seconds.values()))
        rows += [{"law": law, "plant": model.label, **apart(tips[law], truth[law])} for law in seconds]
    finer = f"chain, {ELEMENTS[1]} elements"
    return [*rows, *({"law": law, "plant": finer, **apart(fine[law], truth[law])} for law in seconds)]


def damping(elements: Sequence[int], seconds: float, progress: Callable[[str], None]) -> list[dict[str, Any]]:
    """Run a student on chains of more and more elements, damped by their material or by 1 % of every mode."""
    agent, rows = Hosted(AGENTS[STUDENT], "swing"), []
    for model, arm in (("material", ArmParameters()), ("modal", ArmParameters.linear())):
        last: Lap | None = None
        for count in elements:
            progress(f"damping of the {model}, chain of {count} elements")
            lap = run_lap(agent, on_corner(arm, "swing", count), seconds)
            row = {"damping": model, "elements": count, **_scores(lap)}
            rows.append(row | ({} if last is None else {"from_coarser": apart(lap.tip, last.tip)["rms"]}))
            last = lap
    return rows


def find_row(rows: Sequence[dict[str, Any]], **wanted: Any) -> dict[str, Any]:
    """Return the first row with these entries.

    Raises:
        StopIteration: if there is none.
    """
    return next(row for row in rows if all(row[name] == value for name, value in wanted.items()))


def row_of(lap: str, controller: str, plant: str, own: Lap, truth: Lap) -> dict[str, Any]:
    """Return a row of the tables: scores of a lap and, unless it is the truth itself, how far it is from that."""
    away = apart(own.tip, truth.tip) if own is not truth else {}
    return {"lap": lap, "controller": controller, "plant": plant, **away, **_scores(own)}


def _scores(own: Lap) -> dict[str, float | None]:
    """Return the distances from the reference [m] as the benchmark takes them, and changes of the torque [N m].

    There is no distance after 2 s of a run that was shorter. `torque_change` is the r.m.s. change of the shoulder's
    torque from one control period to the next; `lost` says whether an environment would have ended the episode.
    """
    times = HELD * PERIODS * np.arange(len(own.torque) + 1)
    miss = np.linalg.norm(own.tip[::PERIODS] - square(SquareParameters()).position(times), axis=1)
    later = miss[times >= SETTLED]
    return {
        "score": rms(miss),
        "score_after_2s": rms(later) if len(later) else None,
        "torque_change": rms(np.diff(own.torque[:, 0])),
        "lost": bool(miss.max() > ERROR_LIMIT),
    }


def apart(tip: Array, other: Array) -> dict[str, float | None]:
    """Return the r.m.s., the largest distance, and the r.m.s. after 2 s, if any, of two runs' tips [m]."""
    count = min(len(tip), len(other))
    away = np.linalg.norm(tip[:count] - other[:count], axis=1)
    later = away[round(SETTLED / HELD) :]
    return {"rms": rms(away), "maximum": float(away.max()), "after_2s": rms(later) if len(later) else None}


def distances(row: Mapping[str, Any]) -> str:
    """Write a row's distances from the truth [mm], a dash for one that there is not."""
    lengths = (row[name] for name in ("rms", "after_2s"))
    return " / ".join("-" if length is None else f"{1e3 * length:.3g}" for length in lengths)


def half_a_second_ahead(arm: FlexibleArm, states: Array, lap: Lap) -> dict[str, float]:
    """Return how far an arm's tip is off half a second after it was set on the chain's state [m].

    Args:
        arm: the arm.
        states: of it, read off the chain at each control instant.
        lap: the chain's; its torques act.
    """
    periods, away = round(AHEAD / (HELD * PERIODS)), []
    for first in range(0, len(lap.torque) - periods + 1, round(EVERY / (HELD * PERIODS))):
        plant = Modal(arm)
        plant.state = states[first]
        tip = plant.follow(np.repeat(lap.torque[first : first + periods], PERIODS, axis=0))[-1]
        away.append(float(np.linalg.norm(tip - lap.tip[(first + periods) * PERIODS])))
    return {"median": float(np.median(away)), "rms": rms(np.array(away)), "maximum": max(away)}
