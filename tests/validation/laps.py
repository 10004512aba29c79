"""Laps of any arm under shipped agents and feedback along a plan.

Each of them sees the arm through the model that it was made with: encoders read the arm itself, and strain gauges that
part of its bending which the model's own shapes can express (`flexarm_env.chain.gauges`). All but the feedback along a
plan see it through the drivers of their own environment.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import count
from typing import NamedTuple, Protocol

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from flexarm_agents.board.entries import Entry
from flexarm_baselines.optimal import GOOD, Plan, PlanRegulator, RegulatorWeights, plan_lap
from flexarm_env import ArmParameters, FlexibleArm, SquareParameters, inverse_kinematics, square
from flexarm_env.laps import LAPS, SETTLED
from flexarm_env.predictor import predictor
from scripts.common.plotting import WIDTH, headline, label_ends, plain_ticks, running_rms
from tests.validation.arms import EngineChain, Gauges, Modal, Plant
from tests.validation.hosted import HostedEnv
from tests.validation.kept import kept
from tests.validation.motion import HELD, Array, apart, rms

PERIODS = 10  # `HELD` in a control period of 100 Hz
SECONDS = 16.0  # of a lap
# What feedback may do without exciting vibrations that its model does not have; the baselines' own weights, which
# ask for ten times the stiffness, do excite them.
GENTLE = RegulatorWeights(tip=0.03, speed=1.0)
GENTLY, AGGRESSIVELY = "plan with gentle feedback", "plan with aggressive feedback"
STUDENT = "student of unknown arms"
AGENTS = {"PPO agent": "square", STUDENT: "student_unknown"}  # shipped policies, by their names in the tables
DEFAULT, FOUR, FORMER = "3 polynomials", "4 polynomials", "linear, 2 modes"
MODELS = {f"{n} polynomials": ArmParameters(modes_per_link=n) for n in (2, 3, 4)}
ARMS = MODELS | {FORMER: ArmParameters.linear()}
# by their elements a link; their difference is the second one's error, times three
COARSE, CHAIN = CHAINS = {f"chain, {n} elements": n for n in (10, 20)}
WINDOW = 50  # control periods that a picture takes together: half a second


class Lap(NamedTuple):
    tip: Array  # every `HELD`. Shape (n, 2)
    torque: Array  # of each control period [N m]. Shape (k, 2)
    states: list[Array]  # states of each chosen model, at each control instant

    @property
    def miss(self) -> Array:
        """The distance from the reference at each control instant [m]. Shape (k + 1,)."""
        at = self.tip[::PERIODS]
        return apart(at, square(SquareParameters()).position(HELD * PERIODS * np.arange(len(at))))

    @property
    def score(self) -> float:
        """The r.m.s. distance as the benchmark takes it [mm]."""
        return 1e3 * rms(self.miss)

    @property
    def score_after_2s(self) -> float:
        """The same after 2 s [mm]."""
        return 1e3 * rms(self.miss[round(SETTLED / (HELD * PERIODS)) :])

    @property
    def torque_change(self) -> float:
        """The r.m.s. change of the shoulder's torque from one control period to the next [N m]."""
        return rms(np.diff(self.torque[:, 0]))


class Away(NamedTuple):
    """How far two tips are apart over a run [mm]."""

    rms: float
    maximum: float
    after_2s: float


def away(tip: Array, other: Array) -> Away:
    """Return how far two tips are apart, as long as both run."""
    found = 1e3 * apart(tip, other)
    return Away(rms(found), float(found.max()), rms(found[round(SETTLED / HELD) :]))


class Controller(Protocol):
    def begin(self, plant: Plant) -> Callable[[], tuple[Array, Array]]:
        """Take an arm at rest on the first corner; return what does a control period: torque, tip after each `HELD`."""


def run_lap(controller: Controller, plant: Plant, models: Sequence[FlexibleArm] = (), seconds: float = SECONDS) -> Lap:
    """Run a controller for some seconds on an arm at rest on its first corner; models' states are read off the arm."""
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
    """A shipped agent in its environment; nothing is drawn, sensors have no noise."""

    def __init__(self, source: str, lap: str) -> None:
        """Make it for a lap; its name is the board's."""
        self._entry, self._lap = Entry(source), lap

    def begin(self, plant: Plant) -> Callable[[], tuple[Array, Array]]:
        policy = self._entry.candidate(fresh=not self._entry.batched).policy
        env = HostedEnv(plant, **self._entry.interface)
        predict = predictor(policy, deterministic=True)
        seen, _ = env.reset(seed=0, options=LAPS[self._lap].reset_options(env.settings.direction))
        memory, start = None, np.ones(1, dtype=bool)

        def do_period() -> tuple[Array, Array]:
            nonlocal seen, memory, start
            action, memory = predict(seen, memory, start)
            start = np.zeros(1, dtype=bool)
            seen = env.step(action)[0]
            return env.host.torque, env.host.taken()

        return do_period


class Regulator:
    def __init__(self, lap: str, weights: RegulatorWeights) -> None:
        """Plan the lap, and compute the gains."""
        self.plan = _plan(lap)
        self._regulator = PlanRegulator(self.plan, weights)
        self._gauges = Gauges(self.plan.arm)

    def begin(self, plant: Plant) -> Callable[[], tuple[Array, Array]]:
        times = (n * HELD * PERIODS for n in count())

        def do_period() -> tuple[Array, Array]:
            torque = self._regulator.torque(next(times), self._gauges.state(plant.bend()))
            return torque, plant.advance(torque, PERIODS)

        return do_period


@cache
def _plan(lap: str) -> Plan:
    return plan_lap(FlexibleArm(), lap)


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


def on_start(lap: str, plant: str) -> Plant:
    """Set one of `ARMS`, or one of `CHAINS` of the default arm, on the first corner of a lap."""
    return on_corner(ARMS.get(plant, ArmParameters()), lap, CHAINS.get(plant))


@cache
def controller(lap: str, name: str) -> Controller:
    """Return one of the tables' controllers."""
    if name in (GENTLY, AGGRESSIVELY):
        return Regulator(lap, GENTLE if name == GENTLY else GOOD)
    return Hosted(AGENTS[name], lap)


@kept
def lap_of(lap: str, name: str, plant: str) -> Lap:
    """Run a controller on an arm; off the chain that others are compared with, models' states are read."""
    models = [FlexibleArm(parameters) for parameters in MODELS.values()] if plant == CHAIN else []
    return run_lap(controller(lap, name), on_start(lap, plant), models)


def from_chain(lap: str, name: str, plant: str) -> Away:
    """Return how far an arm's tip is from the chain's."""
    return away(lap_of(lap, name, plant).tip, lap_of(lap, name, CHAIN).tip)


def over_time(lines: Mapping[tuple[str, tuple[str, str]], NDArray[np.float64]], title: str) -> Figure:
    """Draw distances in each control period [m] by lap, and by text and colour of the line; one panel a lap."""
    figure, axes = plt.subplots(len(LAPS), figsize=(WIDTH, 6.4), sharex=True)
    for axis, lap in zip(axes, LAPS, strict=True):
        own = {look: 1e3 * running_rms(away, WINDOW) for (one, look), away in lines.items() if one == lap}
        for (_, colour), away in own.items():
            axis.semilogy(HELD * PERIODS * np.arange(len(away)), away, color=colour, linewidth=1.6)
        axis.set(title=f"{lap} lap", ylabel="r.m.s. over 0.5 s [mm]", ylim=(0.5, 1000.0), xlim=(0.0, 16.0))
        plain_ticks(axis.yaxis)
        axis.set_xticks(range(0, 17, 4))
        label_ends(axis, [*own], [away[-1] for away in own.values()])
    axes[-1].set_xlabel("time [s]")
    headline(figure, title)
    return figure
