"""The square on the chain and on our models: under the paper's laws, and under the shipped agent.

The same law, or the same agent, drives each of them, so that a model's error shows as it does in use: with feedback.
Two further figures have none: how far a model's tip is off at the *chain's* shape (kinematics alone), and how far it is
off half a second after it was set on the chain's state, under the agent's torques.

Under the laws nothing is damped. The agent was trained with 1 % of modal damping, on two modes a link, and drives
modes that it does not know and that are damped by no more unstable. So under it the chain is damped in two ways
(`physics.damping`): by its material, which is the reference; and by 1 % of every clamped mode that it has.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_agents import Trained, load_policy
from flexarm_baselines import FLSAC, IFDC
from flexarm_baselines.flsac import REFERENCE_DEFLECTION
from flexarm_baselines.fuzzy import paper_system
from flexarm_env import (
    ArmParameters,
    FlexibleArm,
    LawParameters,
    LoopCase,
    SensorParameters,
    SquareParameters,
    inverse_kinematics,
    square,
    square_loop,
)
from flexarm_env.chain.gauges import Gauges
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.laps import LAPS
from flexarm_env.rollout import run_batch
from flexarm_env.simulation.closed_loop import observation_blocks
from scripts.validation.engine.chain import EngineChain, Modal, Plant
from scripts.validation.engine.laws import law_lap
from scripts.validation.engine.models import Model
from scripts.validation.engine.motion import peak_bend, rms
from scripts.validation.engine.observer import Observer
from scripts.validation.engine.programmes import HELD

Array = NDArray[np.float64]
SETTLED = 2.0  # [s]; the start's transient is over
SAMPLED = 10  # `HELD` in a control period of the agent; the score counts these instants
OF_THE_MATERIAL = ArmParameters(damping_ratio=0.01, damping_model="material")
OF_EVERY_MODE = ArmParameters.linear()
BRANCH = LAPS["swing"].elbow_branch  # all laps here are swing laps, on the side that the paper is read to have
AHEAD, EVERY = 0.5, 0.25  # a prediction's length, and how often one starts [s]


class Lap(NamedTuple):
    """An agent's lap.

    Attributes:
        tip: every `HELD`. Shape (n, 2).
        torque: every `HELD`. Shape (n - 1, 2).
        states: of each model asked for, at each control instant.
        deflection: at each control instant. Shape (k, 2).
    """

    tip: Array
    torque: Array
    states: list[Array]
    deflection: Array


# --- the paper's laws -------------------------------------------------------------------------------------------------


def fuzzy_gain(deflection: Array) -> float:
    """FLSAC's lambda from the links' tip deflections [m]."""
    return float(paper_system(1.0).evaluate(5.0 * deflection[None] / REFERENCE_DEFLECTION)[0])


LAWS: dict[str, Callable[[Array], float]] = {"ifdc": lambda deflection: 1.0, "flsac": fuzzy_gain}


def laws_on_model(parameters: ArmParameters, seconds: float) -> dict[str, Array]:
    """Return the tip under each law, every `HELD`. Shape (n, 2) each."""
    arm = FlexibleArm(parameters)
    loop, starts = square_loop(arm, [LoopCase(SensorParameters(), LawParameters())] * len(LAWS))
    blocks = observation_blocks(parameters.modes_per_link)
    fuzzy = FLSAC(blocks["modal_coordinates"], np.array([link.tip_values for link in arm.modes]))
    runs = run_batch(loop, starts, [IFDC(), fuzzy], np.ones(2), round(seconds / HELD))
    return {name: run.tip for name, run in zip(LAWS, runs, strict=True)}


def laws_on_chain(elements: int, seconds: dict[str, float]) -> dict[str, Array]:
    """Return the tip of a chain under each law, each for its own time [s]."""
    arm = ArmParameters(damping_ratio=0.0)
    return {
        name: np.array([sight.tip for sight in law_lap(elements, arm, gain, seconds[name])])
        for name, gain in LAWS.items()
    }


# --- the agent --------------------------------------------------------------------------------------------------------


def agent_lap(trained: Trained, plant: Plant, seconds: float, models: Sequence[FlexibleArm] = ()) -> Lap:
    """Run the swing lap of the shipped agent, from rest on the first corner.

    Args:
        trained: the agent.
        plant: the arm, at rest on the corner.
        seconds: length of the lap [s].
        models: whose states are read off the arm.
    """
    env = trained.make_env(elbow_branch=BRANCH).unwrapped
    assert isinstance(env, FlexArmEnv)
    observer, limit = Observer(env), np.array(env.settings.action_limit)
    gauges, action = [Gauges(arm) for arm in models], np.zeros(2)
    tips, torques, deflections = [plant.look().tip[None]], [], []
    states: list[list[Array]] = [[] for _ in models]
    for _ in range(round(seconds / env.settings.control_period)):
        observer.note(tips[-1])
        for gauge, rows in zip(gauges, states, strict=True):
            rows.append(gauge.state(plant.bend()))
        deflections.append(plant.look().deflection)
        observation = observer.look(plant, action)
        action = np.clip(trained.policy.predict(observation, None, np.ones(1, dtype=bool), True)[0], -1.0, 1.0)
        tips.append(plant.advance(action * limit, observer.periods))
        torques += [action * limit] * observer.periods
    return Lap(np.concatenate(tips), np.array(torques), [np.array(rows) for rows in states], np.array(deflections))


def on_corner(parameters: ArmParameters, elements: int | None = None) -> Plant:
    """Set an arm at rest on the first corner: a chain, or without `elements` a model."""
    joints = inverse_kinematics(parameters, square(SquareParameters()).table[0, 1:], BRANCH)
    if elements is None:
        model = Modal(FlexibleArm(parameters))
        model.state[:2] = joints
        return model
    chain = EngineChain(elements, parameters)
    chain.place(joints)
    return chain


def reference_rates(limit: float) -> dict[str, float]:
    """How fast the links of a rigid arm turn on the square: the largest rate of one [rad/s], and how long it is above.

    Args:
        limit: [rad/s]; the part of the lap counts during which a link turns faster.
    """
    path, arm = square(SquareParameters()), ArmParameters()
    points = path.position(np.arange(0.0, path.lap_time, HELD))
    joints = np.unwrap([inverse_kinematics(arm, point, "positive") for point in points], axis=0)
    rates = np.abs(np.diff(np.cumsum(joints, axis=1), axis=0)).max(axis=1) / HELD
    return {"largest": float(rates.max()), "share": float((rates > limit).mean())}


# --- what is compared -------------------------------------------------------------------------------------------------


def laws(
    models: Sequence[Model], seconds: dict[str, float], elements: tuple[int, int], progress: Callable[[str], None]
) -> tuple[list[dict[str, Any]], dict[str, Array]]:
    """Laps under the paper's laws.

    Args:
        models: to be compared with the chain.
        seconds: how long a lap is followed, by law [s].
        elements: of the two chains that the reference is extrapolated from.
        progress: called with a few words.

    Returns:
        Rows, and the tips' errors over time.
    """
    progress("the laws on the chain")
    coarse, fine = (laws_on_chain(n, seconds) for n in elements)
    truth = {name: fine[name] + (fine[name] - coarse[name]) / 3.0 for name in LAWS}
    rows = [_lap_row(name, "chain", truth[name], truth[name]) for name in LAWS]
    rows += [_lap_row(name, f"chain, {elements[1]} elements", fine[name], truth[name]) for name in LAWS]
    arrays = {f"{name} chain": truth[name] for name in LAWS}
    for m in models:
        progress(f"the laws on {m.label}")
        tips = laws_on_model(ArmParameters(damping_ratio=0.0, **m.fields), max(seconds.values()))
        for name in LAWS:
            rows.append(_lap_row(name, m.label, tips[name], truth[name]))
            arrays[f"{name} {m.label}"] = _distance(tips[name], truth[name])
    return rows, arrays


def agent(
    models: Sequence[Model], seconds: float, elements: tuple[int, int], progress: Callable[[str], None]
) -> tuple[list[dict[str, Any]], dict[str, Array]]:
    """Laps of the shipped agent; arguments and results as of `laws`, with what has no feedback."""
    trained = load_policy("square")
    arms = [FlexibleArm(ArmParameters(**m.fields)) for m in models]
    progress("the agent on the chain")
    coarse, fine = (agent_lap(trained, on_corner(OF_THE_MATERIAL, n), seconds, arms) for n in elements)
    truth = fine.tip + (fine.tip - coarse.tip) / 3.0
    rows = [_lap_row("agent", "chain", truth, truth) | {"bend": peak_bend(fine.deflection)}]
    rows.append(_lap_row("agent", f"chain, {elements[1]} elements", fine.tip, truth) | _torque_change(fine))
    arrays = {"agent chain": truth}
    others: dict[str, Lap] = {}
    for n in elements:
        label = f"chain, 1 % of every mode, {n} elements"
        progress(f"the agent on the {label}")
        others[label] = lap = agent_lap(trained, on_corner(OF_EVERY_MODE, n), seconds)
        arrays[f"agent {label}"] = _distance(lap.tip, truth)
    modal = list(others.values())[-1].tip
    rows += [
        _lap_row("agent", label, lap.tip, truth) | _torque_change(lap) | {"modal": _away(lap.tip, modal)}
        for label, lap in others.items()
    ]
    for m, arm, states in zip(models, arms, fine.states, strict=True):
        progress(f"the agent on {m.label}")
        lap = agent_lap(trained, on_corner(arm.parameters), seconds)
        row = _lap_row("agent", m.label, lap.tip, truth)
        row["kinematics"] = _kinematics(arm, states, fine)
        row["ahead"] = _ahead(arm, states, fine)
        row["modal"] = _away(lap.tip, modal)
        rows.append(row | _torque_change(lap))
        arrays[f"agent {m.label}"] = _distance(lap.tip, truth)
    return rows, arrays


def _torque_change(lap: Lap) -> dict[str, float]:
    """Mean change of the shoulder's torque from one control period to the next [N m]."""
    return {"torque_change": float(np.abs(np.diff(lap.torque[::SAMPLED, 0])).mean())}


def _away(tip: Array, other: Array) -> dict[str, float]:
    away = _distance(tip, other)
    return {"rms": rms(away), "maximum": float(away.max())}


def _distance(tip: Array, other: Array) -> Array:
    count = min(len(tip), len(other))
    return np.linalg.norm(tip[:count] - other[:count], axis=1)


def _lap_row(driver: str, which: str, tip: Array, truth: Array) -> dict[str, Any]:
    """Distance from the chain and from the reference [m]; the score as the benchmark has it, every 10 ms."""
    away = _away(tip, truth)
    tip = tip[: len(truth)]
    miss = _distance(tip, square(SquareParameters()).position(HELD * np.arange(len(tip))))[::SAMPLED]
    settled = round(SETTLED / HELD)
    return {
        "driver": driver,
        "model": which,
        **away,
        "score": rms(miss),
        "score_after_2s": rms(miss[settled // SAMPLED :]) if len(tip) > settled else None,
    }


def _kinematics(arm: FlexibleArm, states: Array, lap: Lap) -> dict[str, float]:
    """Return a model's tip at the chain's shapes."""
    return _away(arm.tip(states[:, : arm.size]), lap.tip[::SAMPLED])


def _ahead(arm: FlexibleArm, states: Array, lap: Lap) -> dict[str, float]:
    """Return a model's tip `AHEAD` after it was set on the chain's state."""
    periods, away = round(AHEAD / HELD), []
    for first in range(0, len(lap.torque) - periods + 1, round(EVERY / HELD)):
        plant = Modal(arm)
        plant.state = states[first // SAMPLED]
        tip = plant.follow(lap.torque[first : first + periods])
        away.append(np.linalg.norm(tip[-1] - lap.tip[first + periods]))
    return {"rms": rms(np.array(away)), "maximum": float(np.max(away)) if away else 0.0}
