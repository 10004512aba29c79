"""Plans for a lap of the square: the two standard laps (`flexarm_env.laps`), or any other."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from flexarm_baselines.optimal.plan import Plan
from flexarm_baselines.optimal.problem import TrackingProblem
from flexarm_baselines.optimal.solver import DivergingStartError, Iteration, Solution, SolverOptions, optimise
from flexarm_baselines.optimal.starts import Branch, along, both_sides
from flexarm_env.laps import LAPS
from flexarm_env.parameters import SquareParameters
from flexarm_env.physics.paths import PATHS, rounded
from flexarm_env.simulation.arm import FlexibleArm
from flexarm_env.simulation.limits import rest_state
from flexarm_env.validation import choice, instance, integer, number

CHANGE_WEIGHT = 3e-3  # [m^2]; of torques in `TrackingProblem`, as in the plans of the package for the default arm
DEFLECTION = 1.4  # [m]; the environments end an episode at 1.5 m
OPTIONS: dict[str, Any] = {"change_weight": CHANGE_WEIGHT, "deflection_limit": DEFLECTION}  # of a lap's problem
TRIAL = 40  # iterations after which only the best start goes on


def lap_square(lap: str | SquareParameters) -> SquareParameters:
    """Return the square of a lap: "swing" or "plain", clockwise, or any other as it is."""
    if isinstance(lap, SquareParameters):
        return lap
    return SquareParameters(elbow_branch=LAPS[choice("lap", lap, tuple(LAPS))].elbow_branch)


def lap_problem(
    arm: FlexibleArm,
    lap: str | SquareParameters,
    period: float = 0.01,
    path: str = "square",
    corner_time: float = 0.0,
    **changes: Any,
) -> TrackingProblem:
    """Return the problem of one lap from rest at its first point.

    Args:
        arm: the arm.
        lap: "swing", "plain", or any square.
        period: control period [s]; the lap must be a whole number of them.
        path: name of the reference (`flexarm_env.physics.paths.PATHS`); its size, time and direction are the square's.
        corner_time: over which its corners are blended [s] (`flexarm_env.physics.paths.rounded`).
        **changes: further fields of `TrackingProblem`; `OPTIONS` are those that differ from its defaults.

    Raises:
        ValueError: for another name, a path out of reach, corners that overlap, or a lap of no whole number of periods.
    """
    instance("arm", arm, FlexibleArm)
    task = lap_square(lap)
    way = rounded(PATHS[choice("path", path, tuple(PATHS))](task), number("corner_time", corner_time, "s", least=0.0))
    way.check_reach(arm.parameters)
    number("period", period, "s", above=0.0)
    count = round(task.lap_time / period)
    if count < 1 or abs(count * period - task.lap_time) > 1e-9 * task.lap_time:
        raise ValueError(f"period = {period!r}: the lap of {task.lap_time} s must be a whole number of periods")
    reference = way.position(np.minimum(period * np.arange(count + 1), way.lap_time))
    start = rest_state(arm, reference[0], task.elbow_branch)
    return TrackingProblem(arm, start, reference, **(OPTIONS | {"period": period} | changes))


def usual_starts(lap: str | SquareParameters) -> tuple[tuple[Branch, ...], ...]:
    """Return the sequences of branches that `plan_lap` tries: the start's throughout, and the other one at once."""
    return both_sides(lap_square(lap).elbow_branch, 0.01)


def plan_lap(
    arm: FlexibleArm,
    lap: str | SquareParameters,
    starts: Sequence[Sequence[Branch]] | None = None,
    options: SolverOptions | None = None,
    trial: int = TRIAL,
    progress: Callable[[Iteration], object] | None = None,
    **changes: Any,
) -> Plan:
    """Optimise a lap from several starts; the best one after a trial is carried on.

    Args:
        arm: the arm.
        lap: see `lap_problem`.
        starts: sequences of elbow branches; None: `usual_starts`.
        options: of the solver, for the best start.
        trial: iterations of each start.
        progress: called after each iteration.
        **changes: further arguments of `lap_problem`: `period`, `path`, `corner_time`, fields of `TrackingProblem`.

    Returns:
        The best plan found; `notes["starts"]` has the cost that each start came to in its trial, None if it diverged.

    Raises:
        DivergingStartError: if all starts diverge.
    """
    problem = lap_problem(arm, lap, **changes)
    options = SolverOptions() if options is None else options
    trials = SolverOptions(integer("trial", trial, 0), options.tolerance)
    tried = usual_starts(lap) if starts is None else tuple(tuple(start) for start in starts)
    if not tried:
        raise ValueError("starts: must hold one at least")
    found: list[Solution] = []
    notes: list[dict[str, Any]] = []
    for start in tried:
        cost = None
        with suppress(DivergingStartError):
            found.append(optimise(problem, along(problem, start), trials, progress))
            cost = found[-1].log[-1].cost
        notes.append({"branches": [branch._asdict() for branch in start], "cost": cost})
    if not found:
        raise DivergingStartError("starts: all of them diverge")
    best = min(found, key=lambda solution: solution.log[-1].cost)
    if not best.converged:
        more = optimise(problem, best.run, options, progress)
        best = Solution(*more[:2], best.log + more.log[1:], more.converged)
    return Plan.of(problem, best, starts=notes)
