"""`PathTeacher`: plans for drawn paths on drawn arms, each for the very path and arm of one episode.

A preview controller tracks the path (`optimal.starts`), a few iterations of the solver improve its run, and a
linear-quadratic regulator keeps the arm to the result. The elbow stays on its side, or changes it at the start. Where
the payload changes on the way, stretches without a change are planned one after the other.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexarm_agents.files import put
from flexarm_agents.teaching.config import DAggerConfig
from flexarm_agents.teaching.drawn_paths import LAP, PERIOD, TAUGHT
from flexarm_agents.teaching.teacher import (
    NEEDED,
    Array,
    Flags,
    Floats,
    Indices,
    Pupils,
    Teacher,
    check_task,
    plant,
    read,
)
from flexarm_baselines.optimal import Plan, PlanRegulator, RegulatorWeights, SolverOptions, TrackingProblem
from flexarm_baselines.optimal.phases import optimise_phases
from flexarm_baselines.optimal.solver import DivergingStartError
from flexarm_baselines.optimal.starts import both_sides
from flexarm_baselines.task import payloads_on_the_way
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.feedback import Rollout
from flexarm_env.simulation.limits import rest_state

FIRST = 10**6  # seed of the first planned episode; those after it follow
OPTIONS = SolverOptions(iterations=4, tolerance=3e-3)  # the fifth would lower an error by less than 1 %
NEARLY_STRAIGHT = 0.95  # share of the reach from which on an arm may change its elbow's side when it starts
LEAST = 1e-6  # least mean difficulty: plans that no student has left are all drawn with the same probability
MORE = round((LAP - TAUGHT) / PERIOD)  # control periods for which a stretch is planned beyond its end
BAD = 0.3  # [m]: r.m.s. error of a plan that is not taught


class Plans(NamedTuple):
    """Plans and regulators of n episodes."""

    states: Array  # Shape (n, periods + 1, 4 + 4 m)
    torques: Array  # [N m]. Shape (n, periods, 2)
    gains: Array  # of feedback on the state's deviation [N m/x]. Shape (n, periods, 2, 4 + 4 m)


class PathTeacher(Teacher):
    """Torques along a plan for each episode; the episodes are those of fixed seeds, with delays drawn anew."""

    rescues = True
    seeds: Indices  # of the episodes, by plan
    chosen: Indices  # plan that each arm of the present rollout began with
    difficulty: Floats  # of each plan, see `graded`; NaN before a student was on it

    @classmethod
    def check(cls, settings: Settings) -> None:
        """See `Teacher`."""
        check_task(settings, NEEDED | {"control_period": PERIOD})

    @classmethod
    def along(cls, config: DAggerConfig, env: FlexArmVectorEnv, folder: Path, number: int = 0) -> PathTeacher:
        """Plan the episodes that the folder has no plans of, and return a teacher with all; the batch is reset.

        Args:
            config: how many episodes, and the plans' weights.
            env: the batch.
            folder: holds a file for each plan.
            number: 1 for the batch with the `alternate_options`; each of two batches has every second episode.

        Raises:
            ValueError: see `Teacher.of`; or no path got a plan.
        """
        cls.check(env.settings)
        folder.mkdir(parents=True, exist_ok=True)
        found: dict[int, Plan] = {}
        seeds = range(FIRST + number, FIRST + config.drawn_paths, 1 + bool(config.alternate_options))
        kind = "" if env.settings.payload_changes is None else "-carrying"
        for first in range(0, len(seeds), env.num_envs):
            some = seeds[first : first + env.num_envs]
            env.reset(seed=[*some, *range(env.num_envs - len(some))])
            for i, seed in enumerate(some):
                if (plan := _plan(config, env, i, folder / f"{seed}{kind}.npz")) is not None:
                    found[seed] = plan
        if not found:
            raise ValueError(
                f"drawn_paths = {config.drawn_paths}: no path got a plan with an r.m.s. error below {BAD} m; must be "
                "more paths, or others of change_weight, deflection_limit and options"
            )
        weights = RegulatorWeights(tip=config.tip_weight)
        tables = [(plan.states, plan.torques, PlanRegulator(plan, weights).gains) for plan in found.values()]
        plans = Plans(*(np.stack(table, dtype=np.float32) for table in zip(*tables, strict=True)))
        teacher = cls(plans, env.settings.motor_limit, env.settings.control_period)
        teacher.seeds, teacher.periods = np.array(list(found)), round(TAUGHT / PERIOD)
        teacher.difficulty = np.full(len(found), np.nan)
        return teacher

    def begin(self, env: FlexArmVectorEnv, random: np.random.Generator) -> tuple[Array, Mapping[str, Any]]:
        """See `Teacher`."""
        count = env.num_envs
        known = np.isfinite(self.difficulty)
        mean = max(self.difficulty[known].mean(), LEAST) if known.any() else 1.0
        chances = np.where(known, self.difficulty, mean) + mean
        self.chosen = random.choice(len(self.seeds), count, len(self.seeds) < count, chances / chances.sum())
        drawn = {name: random.uniform(*env.settings.range_of(name), count) for name in ("delay", "actuation_delay")}
        return env.reset(seed=self.seeds[self.chosen].tolist(), options={"parameters": drawn})

    def graded(self, shares: Floats) -> None:
        """See `Teacher`; a path's chance to be drawn grows with the share in which the student was off its plan."""
        self.difficulty[self.chosen] = shares

    def pupils(self, env: FlexArmVectorEnv, begun: Flags, before: Pupils | None = None) -> Pupils:
        """See `Teacher`; an episode that an arm begins when it has lost another has no plan."""
        lap = self.chosen if before is None else np.where(begun, -1, before.lap)
        return Pupils(lap, env.episode.parameters)

    def _corners(self, pupils: Pupils) -> list[tuple[tuple[Indices, ...], Floats]]:
        return [((pupils.lap,), np.ones(len(pupils.lap)))]


def _plan(config: DAggerConfig, env: FlexArmVectorEnv, index: int, path: Path) -> Plan | None:
    """Return the plan of an environment's present episode, by its file or made and put there; None: there is none.

    Raises:
        ValueError: if the file has a plan for another episode.
    """
    drawn = {name: float(values[index]) for name, values in env.episode.parameters.items()}
    parameters = plant(env.settings.flexible_arm.parameters, drawn["payload_mass"], drawn["stiffness"])
    arm = FlexibleArm(replace(parameters, damping_ratio=drawn["damping"]))
    reference, side = env.simulator.path(index), env.episode.elbow_branch[index]
    wishes: dict[str, Any] = {"change_weight": config.change_weight, "deflection_limit": config.deflection_limit}
    problem = TrackingProblem(arm, rest_state(arm, reference[0], side), reference, env.settings.motor_limit, **wishes)
    payloads = payloads_on_the_way(env.settings)
    if payloads is not None:
        wishes["payload_changes"] = [list(change) for change in env.settings.payload_changes]
    if (plan := read(path, problem, wishes)) is None:
        near = np.linalg.norm(reference[0]) > NEARLY_STRAIGHT * parameters.reach
        with suppress(DivergingStartError):
            found = optimise_phases(problem, payloads, both_sides(side, PERIOD)[: 1 + near], OPTIONS, MORE)
            plan = Plan.of(problem, found, **wishes)
            put(path, lambda aside: plan.save(aside, run=payloads is not None))
    if plan is None or problem.cost(Rollout(plan.states, plan.torques)) >= BAD**2:
        return None
    return replace(plan, payloads=payloads)
