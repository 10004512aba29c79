"""`Teacher`: the best known plan of an arm's own plant, and feedback of its true state along it.

Its plans are for a box of plants: each standard lap, optimised for a grid of payloads and stiffnesses, in a folder.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.environments import make_one
from flexarm_agents.files import put
from flexarm_agents.teaching.config import DAggerConfig
from flexarm_baselines.optimal import (
    Plan,
    PlanRegulator,
    RegulatorWeights,
    SolverOptions,
    TrackingProblem,
    lap_problem,
    load_plan,
    optimise,
)
from flexarm_baselines.optimal.phases import plan_phases
from flexarm_baselines.task import Task
from flexarm_env.actions import IDEAL_MOTORS, TORQUE_LIMIT
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.laps import LAPS
from flexarm_env.parameters import ArmParameters, SquareParameters
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.validation import shown

Array = NDArray[np.float32]
Flags = NDArray[np.bool_]
Floats = NDArray[np.float64]
Indices = NDArray[np.int64]
OPTIONS = SolverOptions(iterations=60, tolerance=3e-3)  # from a neighbour's plan; a hundredth of a millimetre is left
TURN = 2.0 * np.pi
NEEDED: dict[str, Any] = {"action_mode": "torque", **IDEAL_MOTORS}
OF_LAPS = {  # what needs the plans at hand
    "reference": ("square",),
    **{name: getattr(SquareParameters(), name) for name in ("direction", "side", "lap_time", "start_corner")},
    "control_period": 0.01,
    "torque_limit": TORQUE_LIMIT,
}
BRANCHES = [lap.elbow_branch for lap in LAPS.values()]


class Pupils(NamedTuple):
    """Arms that the teacher drives, with what it may know of them."""

    lap: Indices  # index of the lap or path that each runs, in the order of the plans; -1: of none. Shape (n,)
    parameters: Mapping[str, Floats]  # quantities of their episodes, as `Episode` has them. Shape (n,) each


class Teacher:
    """Torques for arms whose state and plant are known.

    Between the plants of the grid, plans and gains are interpolated linearly. Where motors are late, the torques are
    those of the plan at the moment at which they act.
    """

    rescues = False  # it takes over arms that are far off their plans

    def __init__(self, plans: Any, limits: tuple[float, float], period: float) -> None:
        """Keep the plans of the grid (`Bank`), the limits of the torques [N m] and the control period [s]."""
        self.plans, self.limits, self.period = plans, np.array(limits), period
        self.periods = plans.torques.shape[-2]  # of a rollout

    @classmethod
    def check(cls, settings: Settings) -> None:
        """Refuse an environment that it has no plans for; where the payload changes, any single reference will do.

        Raises:
            ValueError: naming the option.
        """
        check_task(settings, NEEDED if settings.payload_changes is not None else NEEDED | OF_LAPS)

    @classmethod
    def of(cls, config: DAggerConfig, settings: Settings, folder: Path) -> Teacher:
        """Make a teacher for an environment of standard laps, with a grid over what it draws.

        Where the payload changes within the lap, plans are made anew each time.

        Raises:
            ValueError: see `check`; or a file in the folder has a plan for something else.
        """
        cls.check(settings)
        payloads, stiffnesses = (
            np.unique(np.linspace(*settings.range_of(name), count)).tolist()
            for name, count in zip(("payload_mass", "stiffness"), config.plants, strict=True)
        )
        if settings.payload_changes is not None:
            plans = carrying_plans(config, payloads, stiffnesses)
        else:
            wishes = {"change_weight": config.change_weight, "deflection_limit": config.deflection_limit}
            arm, corner_time = settings.flexible_arm.parameters, settings.corner_time
            plans = lap_plans(arm, payloads, stiffnesses, folder, wishes, corner_time)
        found = Bank.of(plans, payloads, stiffnesses, config.tip_weight)
        return cls(found, settings.motor_limit, settings.control_period)

    def begin(self, env: FlexArmVectorEnv, random: np.random.Generator) -> tuple[Array, Mapping[str, Any]]:
        """Begin the episodes of a rollout; return observations and infos."""
        seeds = random.integers(2**31, size=env.num_envs).tolist()
        return env.reset(seed=seeds, options={"elbow_branch": [BRANCHES[i % 2] for i in range(env.num_envs)]})

    def pupils(self, env: FlexArmVectorEnv, begun: Flags, before: Pupils | None = None) -> Pupils:
        """Return the arms of a batch.

        Args:
            env: the batch.
            begun: which arms have just begun an episode. Shape (n,).
            before: what was returned for the period before; None: in the first one.
        """
        lap = np.array([BRANCHES.index(branch) for branch in env.episode.elbow_branch.tolist()])
        return Pupils(lap, env.episode.parameters)

    def actions(self, pupils: Pupils, period: Indices, states: Floats) -> tuple[NDArray[np.float32], Floats]:
        """Choose actions in [-1, 1], and return how far the feedback changes them. Shape (n, 2) each.

        Args:
            pupils: the arms.
            period: control periods since each one's lap began. Shape (n,).
            states: true ones. Shape (n, 4 + 4 m).
        """
        last = self.plans.torques.shape[-2] - 1
        now = np.minimum(period, last)
        late = pupils.parameters["actuation_delay"] / self.period
        whole = np.floor(late).astype(np.int64)
        first, then = (np.minimum(now + whole + more, last) for more in (0, 1))
        share = (late - whole)[:, None]
        planned, wanted = np.zeros((len(now), 2)), np.zeros(states.shape)
        gains = np.zeros((len(now), 2, states.shape[1]))
        for place, weight in self._corners(pupils):
            torques = (1.0 - share) * self.plans.torques[(*place, first)] + share * self.plans.torques[(*place, then)]
            planned += weight[:, None] * torques
            wanted += weight[:, None] * self.plans.states[(*place, now)]
            gains += weight[:, None, None] * self.plans.gains[(*place, now)]
        off = states - wanted
        off[:, 0] -= TURN * np.round(off[:, 0] / TURN)
        feedback = np.einsum("nij,nj->ni", gains, off) / self.limits
        feedback[pupils.lap < 0] = np.inf
        return np.clip(planned / self.limits + feedback, -1.0, 1.0).astype(np.float32), feedback

    def graded(self, shares: Floats) -> None:
        """Take note of the share of a rollout in which the student was far off each arm's plan. Shape (n,)."""

    def _corners(self, pupils: Pupils) -> list[tuple[tuple[Indices, ...], Floats]]:
        """Return the places of each arm's plans, those of the grid's plants about its own, with their weights."""
        parameters = pupils.parameters
        payload = _bracket(self.plans.payloads, parameters["payload_mass"])
        stiffness = _bracket(self.plans.stiffnesses, parameters["stiffness"])
        return [((pupils.lap, p, s), one * other) for p, one in payload for s, other in stiffness]


def check_task(settings: Settings, needed: Mapping[str, Any]) -> None:
    """Refuse an environment that has other options than a teacher needs, or draws them."""
    for name, value in needed.items():
        own = settings.motor_limit if name == "torque_limit" else getattr(settings, name)
        if own != value:
            raise ValueError(f"{name} = {shown(own)}: the teacher has plans for {value!r} only")
    for name in (*needed, "torque_limit"):
        if name in settings.randomisation:
            drawn = shown(settings.randomisation[name])
            raise ValueError(f"randomisation[{name!r}] = {drawn}: must be left out; the teacher has plans for one")


def _bracket(grid: Floats, values: Floats) -> list[tuple[Indices, Floats]]:
    """Return the neighbours of values in a grid, with their weights; one neighbour where the grid has one entry."""
    if len(grid) == 1:
        return [(np.zeros(len(values), dtype=np.int64), np.ones(len(values)))]
    low = np.clip(np.searchsorted(grid, values, side="right") - 1, 0, len(grid) - 2)
    share = (values - grid[low]) / (grid[low + 1] - grid[low])
    return [(low, 1.0 - share), (low + 1, share)]


class Bank(NamedTuple):
    """Plans and regulators of all plants of a grid, for both laps."""

    payloads: Floats  # of the grid [kg]. Shape (p,)
    stiffnesses: Floats  # of the grid, as factors. Shape (s,)
    states: Floats  # by lap, payload, stiffness. Shape (2, p, s, n + 1, 4 + 4 m)
    torques: Floats  # [N m]. Shape (2, p, s, n, 2)
    gains: Floats  # of feedback on the state's deviation [N m/x]. Shape (2, p, s, n, 2, 4 + 4 m)

    @classmethod
    def of(cls, plans: Sequence[Plan], payloads: Sequence[float], stiffnesses: Sequence[float], tip: float) -> Bank:
        """Stack plans, ordered by lap, payload and stiffness, and regulators that weigh a deviation `tip` [m] as 1."""
        gains = [PlanRegulator(plan, RegulatorWeights(tip=tip)).gains for plan in plans]
        columns = [plan.states for plan in plans], [plan.torques for plan in plans], gains
        shape = (len(LAPS), len(payloads), len(stiffnesses))
        stacked = (np.stack(column).reshape(*shape, *column[0].shape) for column in columns)
        return cls(np.array(payloads), np.array(stiffnesses), *stacked)


def lap_plans(
    arm: ArmParameters,
    payloads: Sequence[float],
    stiffnesses: Sequence[float],
    folder: Path,
    wishes: Mapping[str, Any],
    corner_time: float = 0.0,
) -> list[Plan]:
    """Make the plans that the folder does not hold yet, each from its neighbour's torques, and return all.

    Args:
        arm: nominal arm.
        payloads: of the grid [kg], increasing.
        stiffnesses: factors of the grid, increasing.
        folder: holds a file for each plan.
        wishes: fields of `TrackingProblem` that all plans share.
        corner_time: over which the square's corners are blended [s].
    """
    folder.mkdir(parents=True, exist_ok=True)
    made: dict[tuple[str, int, int], Plan] = {}
    for lap, p, s in product(LAPS, range(len(payloads)), range(len(stiffnesses))):
        path = folder / f"{lap}-payload-{payloads[p]:g}-stiffness-{stiffnesses[s]:g}.npz"
        one = FlexibleArm(plant(arm, payloads[p], stiffnesses[s]))
        problem = lap_problem(one, lap, corner_time=corner_time, **wishes)
        neighbour = made.get((lap, p - 1, s)) or made.get((lap, p, s - 1)) or load_plan(f"default_{lap}")
        made[lap, p, s] = read(path, problem, wishes) or _make(path, problem, neighbour)
    return list(made.values())


def carrying_plans(config: DAggerConfig, payloads: Sequence[float], stiffnesses: Sequence[float]) -> list[Plan]:
    """Make plans for an environment whose payload changes within the lap; arguments as of `lap_plans`."""
    with closing(make_one(config.environment, config.options | config.curriculum_options | {"frame": "world"})) as env:
        task = Task.of(env)
    assert task.payloads is not None
    own = task.reference, task.payloads
    return [
        plan_phases(plant(task.arm, p, s), *own, lap.elbow_branch, task.period, task.torque_limit)
        for lap, p, s in product(LAPS.values(), payloads, stiffnesses)
    ]


def plant(arm: ArmParameters, payload: float, stiffness: float) -> ArmParameters:
    """Return an arm with another payload [kg], and with rigidities times a factor."""
    first, second = arm.flexural_rigidities
    return replace(arm, payload_mass=payload, flexural_rigidities=(stiffness * first, stiffness * second))


def read(path: Path, problem: TrackingProblem, wishes: Mapping[str, Any]) -> Plan | None:
    """Return the plan in a file; None if there is none.

    Raises:
        ValueError: if it is the plan of another problem, or was made with other wishes.
    """
    if not path.is_file():
        return None
    plan = Plan.load(path)
    if not solves(plan, problem, wishes):
        raise ValueError(
            f"{path}: a plan of another arm or path, or not with {dict(wishes)}; remove it, or name another folder"
        )
    return plan


def solves(plan: Plan, problem: TrackingProblem, wishes: Mapping[str, Any]) -> bool:
    """Return whether a plan is one of a problem, made with wishes that its notes have."""
    return (
        plan.parameters == problem.arm.parameters
        and plan.period == problem.period
        and np.array_equal(plan.limits, problem.limits)
        and plan.reference.shape == problem.reference.shape
        and np.allclose(plan.reference, problem.reference, atol=1e-9)
        and wishes.items() <= plan.notes.items()
    )


def _make(path: Path, problem: TrackingProblem, neighbour: Plan) -> Plan:
    """Optimise from another plant's plan; the start's feedback is that plan's, so that it does not drift away."""
    start = PlanRegulator(neighbour).rollout(problem.initial_state, problem.arm)
    plan = Plan.of(problem, optimise(problem, start, OPTIONS))
    put(path, plan.save)
    return plan
