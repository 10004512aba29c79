"""Laps of any arm under shipped agents and feedback along a plan.

Each of them sees the arm through the model that it was made with: encoders read the arm itself, and strain gauges that
part of its bending which the model's own shapes can express (`flexarm_env.chain.gauges`). All but the feedback along a
plan see it through the drivers of their own environment.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache
from itertools import count
from typing import Any, NamedTuple

import numpy as np

from flexarm_agents.board.entries import Entry
from flexarm_baselines.optimal import GOOD, PlanRegulator, RegulatorWeights, plan_lap
from flexarm_env import ArmParameters, FlexibleArm, SquareParameters, inverse_kinematics, square
from flexarm_env.codegen.arrays import Four
from flexarm_env.envs.drawing import Drawing, drawing_of
from flexarm_env.envs.hosted import HostedSimulator
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.single import FlexArmEnv
from flexarm_env.laps import LAPS, SETTLED
from flexarm_env.physics.coordinates import rigid_tip
from flexarm_env.physics.sensing import Truth
from flexarm_env.predictor import predictor
from tests.validation.arms import EngineChain, Gauges, Modal, Plant
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


def run_lap(controller: Controller, plant: Plant, models: Sequence[FlexibleArm] = ()) -> Lap:
    """Run a controller on an arm at rest on its first corner; models' states are read off the arm.

    A controller's `begin` returns what does a control period, and gives its torque and the tip after each `HELD`.
    """
    gauges = [Gauges(arm) for arm in models]
    tips, torques = [plant.look().tip[None]], []
    states: list[list[Array]] = [[] for _ in models]
    next_period = controller.begin(plant)
    for _ in range(round(SECONDS / (HELD * PERIODS))):
        for gauge, rows in zip(gauges, states, strict=True):
            rows.append(gauge.state(plant.bend()))
        torque, tip = next_period()
        torques.append(torque)
        tips.append(tip)
    return Lap(np.concatenate(tips), np.array(torques), [np.array(rows) for rows in states])


class AnyArm:
    """An arm of the studies as that of an environment (`flexarm_env.envs.hosted.Plant`); it keeps where the tip was.

    Encoders and the late sensor read the arm itself, strain gauges that part of its bending which the environment's own
    shapes can express (`flexarm_env.chain.gauges`). `torque` [N m] acted last.
    """

    def __init__(self, arm: Plant, settings: Settings) -> None:
        """Take an arm that is where the episode begins."""
        own = settings.flexible_arm
        end = settings.sensor, settings.sensor_position
        assert end == ("true", own.parameters.link_lengths[1]), "the sensor must read the end of link 2"
        self._periods = round(settings.control_period / settings.substeps / HELD)
        whole = np.isclose(self._periods * HELD * settings.substeps, settings.control_period)
        assert whole, f"the physics step must be a multiple of {HELD} s"
        self._arm, self._settings, self._gauges = arm, settings, Gauges(own)
        self._tips: list[Array] = []
        self.torque = np.zeros(2)

    def taken(self) -> Array:
        """Return where the tip was every `HELD` since the last call. Shape (n, 2)."""
        tips, self._tips = self._tips, []
        return np.concatenate(tips)

    def begin(self, state: Array, quantities: Mapping[str, float]) -> None:
        assert np.allclose(self._arm.look().joints, state[:2], atol=1e-9), "the arm must be where the episode begins"

    def advance(self, command: Array, reference: Four | None) -> Array:
        self.torque = np.array(command)
        self._tips.append(self._arm.advance(command, self._periods))
        return command

    def readings(self) -> Array:
        return self._arm.end()

    def encoders(self) -> Array:
        sight = self._arm.look()
        return np.concatenate([sight.joints, sight.rates])

    def truth(self) -> Truth:
        sight, state = self._arm.look(), self._gauges.state(self._arm.bend())
        own = self._settings.flexible_arm
        rigid = rigid_tip(own.parameters.link_lengths, sight.joints)
        deflections = (own.tip_deflection(half).tolist() for half in np.split(state, 2))
        return Truth(state.tolist(), sight.tip.tolist(), rigid.tolist(), *deflections)

    def drawing(self) -> Drawing:
        return drawing_of(self._settings, self._gauges.state(self._arm.bend()))


class HostedEnv(FlexArmEnv):
    """An environment around an arm of the studies; it ends no episode early."""

    host: AnyArm  # the arm

    def __init__(self, arm: Plant, **options: Any) -> None:
        """Lay it out around an arm where the episode begins."""
        self._given = arm
        super().__init__(**(options | {"deflection_limit": None, "error_limit": None}))

    def _simulator_of(self, settings: Settings) -> HostedSimulator:
        self.host = AnyArm(self._given, settings)
        return HostedSimulator(settings, self.host)


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


_plan = cache(lambda lap: plan_lap(FlexibleArm(), lap))


class Regulator:
    def __init__(self, lap: str, weights: RegulatorWeights) -> None:
        """Plan the lap, and compute the gains."""
        plan = _plan(lap)
        self._regulator, self._gauges = PlanRegulator(plan, weights), Gauges(plan.arm)

    def begin(self, plant: Plant) -> Callable[[], tuple[Array, Array]]:
        times = (n * HELD * PERIODS for n in count())

        def do_period() -> tuple[Array, Array]:
            torque = self._regulator.torque(next(times), self._gauges.state(plant.bend()))
            return torque, plant.advance(torque, PERIODS)

        return do_period


Controller = Hosted | Regulator


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


@cache
def controller(lap: str, name: str) -> Controller:
    """Return one of the tables' controllers."""
    if name in (GENTLY, AGGRESSIVELY):
        return Regulator(lap, GENTLE if name == GENTLY else GOOD)
    return Hosted(AGENTS[name], lap)


@kept
def lap_of(lap: str, name: str, plant: str) -> Lap:
    """Run a controller on one of `ARMS` or `CHAINS`; off `CHAIN`, models' states are read."""
    models = [FlexibleArm(parameters) for parameters in MODELS.values()] if plant == CHAIN else []
    arm = on_corner(ARMS.get(plant, ArmParameters()), lap, CHAINS.get(plant))
    return run_lap(controller(lap, name), arm, models)


def from_chain(lap: str, name: str, plant: str) -> Away:
    """Return how far an arm's tip is from the chain's."""
    return away(lap_of(lap, name, plant).tip, lap_of(lap, name, CHAIN).tip)
