"""Controllers that close their loop on any arm: those of the registry, shipped agents, regulators along a plan.

Each of them sees the arm through the model that it was made with: encoders read the arm itself, and strain gauges that
part of its bending which the model's own shapes can express (`flexarm_env.chain.gauges`). All but the regulators see
it through the drivers of their own environment.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from itertools import count
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.board.rows import Row
from flexarm_baselines.optimal import GOOD, Plan, PlanRegulator, RegulatorWeights, plan_lap
from flexarm_baselines.optimal.laps import CHANGE_WEIGHT
from flexarm_env import ArmParameters, FlexibleArm, SquareParameters, inverse_kinematics, square
from flexarm_env.chain.gauges import Gauges
from flexarm_env.laps import LAPS
from flexarm_env.predictor import predictor
from scripts.validation.engine.chain import EngineChain, Modal, Plant
from scripts.validation.engine.programmes import HELD
from scripts.validation.plant.hosted import HostedEnv

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


class Period(NamedTuple):
    """A control period.

    Attributes:
        torque: that acted [N m]. Shape (2,).
        tip: after each `HELD` of it [m]. Shape (n, 2).
    """

    torque: Array
    tip: Array


class Controller(Protocol):
    """Drives an arm."""

    def begin(self, plant: Plant) -> Callable[[], Period]:
        """Take an arm at rest on the first corner; return a function that does the next control period."""


def run_lap(controller: Controller, plant: Plant, seconds: float, models: Sequence[FlexibleArm] = ()) -> Lap:
    """Run a controller on an arm at rest on its first corner.

    Args:
        controller: the controller.
        plant: the arm.
        seconds: length of the run [s].
        models: whose states are read off the arm.
    """
    gauges = [Gauges(arm) for arm in models]
    tips, torques = [plant.look().tip[None]], []
    states: list[list[Array]] = [[] for _ in models]
    next_period = controller.begin(plant)
    for _ in range(round(seconds / (HELD * PERIODS))):
        for gauge, rows in zip(gauges, states, strict=True):
            rows.append(gauge.state(plant.bend()))
        torque, tip = next_period()
        torques.append(torque)
        tips.append(tip)
    return Lap(np.concatenate(tips), np.array(torques), [np.array(rows) for rows in states])


class Hosted:
    """A controller of the registry or a shipped agent, in its environment; nothing is drawn, sensors have no noise."""

    def __init__(self, source: str, lap: str) -> None:
        """Make it for a lap; its name is the board's."""
        self._row, self._lap = Row(source), lap

    def begin(self, plant: Plant) -> Callable[[], Period]:
        """See `Controller`."""
        policy = self._row.candidate(fresh=not self._row.batched).policy
        env = HostedEnv(plant, **self._row.interface)
        predict = predictor(policy, deterministic=True)
        seen, _ = env.reset(seed=0, options=LAPS[self._lap].reset_options(env.settings.direction))
        memory, start = None, np.ones(1, dtype=bool)

        def do_period() -> Period:
            nonlocal seen, memory, start
            action, memory = predict(seen, memory, start)
            start = np.zeros(1, dtype=bool)
            seen = env.step(action)[0]
            return Period(env.host.torque, env.host.taken())

        return do_period


class Regulator:
    """Feedback along a plan for an arm."""

    def __init__(
        self, arm: ArmParameters, lap: str, weights: RegulatorWeights, change_weight: float = CHANGE_WEIGHT
    ) -> None:
        """Plan the lap with a weight on changes of the torques (`TrackingProblem`), and compute the gains."""
        self.plan = _plan(arm, lap, change_weight)
        self._regulator = PlanRegulator(self.plan, weights)
        self._gauges = Gauges(self.plan.arm)

    def begin(self, plant: Plant) -> Callable[[], Period]:
        """See `Controller`."""
        times = (n * HELD * PERIODS for n in count())

        def do_period() -> Period:
            torque = self._regulator.torque(next(times), self._gauges.state(plant.bend()))
            return Period(torque, plant.advance(torque, PERIODS))

        return do_period


@cache
def _plan(arm: ArmParameters, lap: str, change_weight: float) -> Plan:
    return plan_lap(FlexibleArm(arm), lap, change_weight=change_weight)


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
