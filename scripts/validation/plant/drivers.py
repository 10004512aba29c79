"""Controllers that close their loop on any arm: the shipped agent, and regulators along an optimal plan.

Each of them sees the arm through the model that it was made with: encoders read the arm itself, and strain gauges that
part of its bending which the model's own shapes can express (`flexarm_env.chain.gauges`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from flexarm_agents import Trained
from flexarm_baselines.optimal import GOOD, Plan, PlanRegulator, RegulatorWeights, plan_lap
from flexarm_env import ArmParameters, FlexibleArm, SquareParameters, inverse_kinematics, square
from flexarm_env.chain.gauges import Gauges
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.laps import LAPS
from scripts.validation.engine.chain import EngineChain, Modal, Plant
from scripts.validation.engine.observer import Observer
from scripts.validation.engine.programmes import HELD

Array = NDArray[np.float64]
PERIODS = 10  # `HELD` in a control period of 100 Hz
# What a regulator may do without exciting vibrations that its model does not have; the baselines' own weights, which
# ask for ten times the stiffness, do excite them.
GENTLE = RegulatorWeights(tip=0.03, speed=1.0)
WEIGHTS = {"gentle": GENTLE, "aggressive": GOOD}


class Lap(NamedTuple):
    """A lap under a controller.

    Attributes:
        tip: every `HELD`. Shape (n, 2).
        torque: of each control period [N m]. Shape (k, 2).
        states: of each model asked for, at each control instant.
    """

    tip: Array
    torque: Array
    states: list[Array]


class Controller(Protocol):
    """Gives the torque of each control period."""

    def begin(self) -> Callable[[Plant, Array], Array]:
        """Return a fresh one: a function of the arm and where its tip was since the last call [N m]. Shape (2,)."""


def run_lap(controller: Controller, plant: Plant, seconds: float, models: Sequence[FlexibleArm] = ()) -> Lap:
    """Run a controller on an arm at rest on its first corner.

    Args:
        controller: the controller.
        plant: the arm.
        seconds: length of the run [s].
        models: whose states are read off the arm.
    """
    torque_of, gauges = controller.begin(), [Gauges(arm) for arm in models]
    tips, torques = [plant.look().tip[None]], []
    states: list[list[Array]] = [[] for _ in models]
    for _ in range(round(seconds / (HELD * PERIODS))):
        for gauge, rows in zip(gauges, states, strict=True):
            rows.append(gauge.state(plant.bend()))
        torques.append(torque_of(plant, tips[-1]))
        tips.append(plant.advance(torques[-1], PERIODS))
    return Lap(np.concatenate(tips), np.array(torques), [np.array(rows) for rows in states])


class Agent:
    """A trained agent, with the observations of the environment that it was trained on."""

    def __init__(self, trained: Trained, lap: str) -> None:
        """Make it for a lap."""
        self._policy, self._branch = trained.policy, LAPS[lap].elbow_branch
        env = trained.make_env(elbow_branch=self._branch).unwrapped
        assert isinstance(env, FlexArmEnv)
        self._env = env

    def begin(self) -> Callable[[Plant, Array], Array]:
        """See `Controller`."""
        observer, limit = Observer(self._env), np.array(self._env.settings.action_limit)
        action = np.zeros(2)

        def torque(plant: Plant, tips: Array) -> Array:
            nonlocal action
            observer.note(tips)
            seen = observer.look(plant, action)
            action = np.clip(self._policy.predict(seen, None, np.ones(1, dtype=bool), True)[0], -1.0, 1.0)
            return action * limit

        return torque


class Regulator:
    """Feedback along the best plan known for an arm."""

    def __init__(self, arm: ArmParameters, lap: str, weights: RegulatorWeights) -> None:
        """Plan the lap, and compute the gains."""
        self._regulator = PlanRegulator(_plan(arm, lap), weights)
        self._gauges = Gauges(self._regulator.plan.arm)

    def begin(self) -> Callable[[Plant, Array], Array]:
        """See `Controller`."""
        period = 0

        def torque(plant: Plant, tips: Array) -> Array:
            nonlocal period
            period += 1
            time = (period - 1) * HELD * PERIODS
            return np.asarray(self._regulator.torque(time, self._gauges.state(plant.bend())))

        return torque


@cache
def _plan(arm: ArmParameters, lap: str) -> Plan:
    return plan_lap(FlexibleArm(arm), lap)


def on_corner(parameters: ArmParameters, lap: str, elements: int | None = None) -> Plant:
    """Set an arm at rest on the first corner of a lap: a chain, or without `elements` the assumed-modes arm."""
    joints = inverse_kinematics(parameters, square(SquareParameters()).table[0, 1:], LAPS[lap].elbow_branch)
    if elements is None:
        model = Modal(FlexibleArm(parameters))
        model.state[:2] = joints
        return model
    chain = EngineChain(elements, parameters)
    chain.place(joints)
    return chain
