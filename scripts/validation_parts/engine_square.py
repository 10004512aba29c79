"""The square on the chain and on our models: under the paper's laws, and under the shipped agent.

The same law, or the same agent, drives each of them, so that a model's error shows as it does in use: with feedback.
Two further figures have no feedback: how far a model's tip is off at the *chain's* shape (kinematics alone), and how far
it is off half a second after it was set on the chain's state, under the agent's torques.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_agents import Trained, load_policy
from flexarm_baselines import FLSAC, IFDC
from flexarm_baselines.fuzzy import paper_system
from flexarm_baselines.flsac import REFERENCE_DEFLECTION
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
from flexarm_env.rollout import run_batch
from flexarm_env.simulation import observation_blocks
from validation_parts.engine_chain import HELD, Chain, Gauges, Modal, Plant
from validation_parts.engine_laws import law_lap
from validation_parts.engine_observer import Observer
from validation_parts.engine_runs import rms

Array = NDArray[np.float64]
SETTLED = 2.0  # [s]; the start's transient is over
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
    """The tip under each law, every `HELD`. Shape (n, 2) each."""
    arm = FlexibleArm(parameters)
    loop, starts = square_loop(arm, [LoopCase(SensorParameters(), LawParameters())] * len(LAWS))
    blocks = observation_blocks(parameters.modes_per_link)
    fuzzy = FLSAC(blocks["modal_coordinates"], np.array([link.tip_values for link in arm.modes]))
    runs = run_batch(loop, starts, [IFDC(), fuzzy], np.ones(2), round(seconds / HELD))
    return {name: run.tip for name, run in zip(LAWS, runs, strict=True)}


def laws_on_chain(elements: int, seconds: float) -> dict[str, Array]:
    """The same on a chain."""
    arm = ArmParameters(modal_damping_ratio=0.0)
    return {
        name: np.array([sight.tip for sight in law_lap(elements, arm, gain, seconds)]) for name, gain in LAWS.items()
    }


# --- the agent --------------------------------------------------------------------------------------------------------


def agent_lap(trained: Trained, plant: Plant, seconds: float, models: Sequence[FlexibleArm] = ()) -> Lap:
    """A lap of the shipped agent from rest on the first corner.

    Args:
        trained: the agent.
        plant: the arm, at rest on the corner.
        seconds: length of the lap [s].
        models: whose states are read off the arm.
    """
    env = trained.make_env().unwrapped
    observer, limit = Observer(env), np.array(env.settings.action_limit)
    gauges, action = [Gauges(arm) for arm in models], np.zeros(2)
    tips, torques, deflections, states = [plant.look().tip[None]], [], [], [[] for _ in models]
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
    """An arm at rest on the first corner: a chain, or without `elements` a model."""
    joints = inverse_kinematics(parameters, square(SquareParameters()).table[0, 1:], "positive")
    if elements is None:
        model = Modal(FlexibleArm(parameters))
        model.state[:2] = joints
        return model
    chain = Chain(elements, parameters)
    chain.place(joints)
    return chain
