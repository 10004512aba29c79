"""Search for the best lap of an arm: every sequence of elbow branches on trial, then the best ones to convergence."""

import itertools
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from flexarm_agents.files import put
from flexarm_agents.teaching.teacher import solves
from flexarm_baselines.optimal import (
    Branch,
    DivergingStartError,
    Iteration,
    Plan,
    PlanRegulator,
    SolverOptions,
    TrackingProblem,
    along,
    optimise,
)
from flexarm_baselines.optimal.solver import Solution, rollout
from flexarm_env.parameters import SquareParameters
from flexarm_env.simulation.feedback import Rollout

SIGNS = {"positive": "+", "negative": "-"}
CHANGE = 0.4  # [s], of sides in the starts
GRAFT = 2.0  # [s], after which another plan takes over


class Effort(NamedTuple):
    """How much is tried."""

    trial: int  # iterations of each start
    finalists: int  # so many of the best starts go on
    iterations: int  # of each of these at most


class Candidate(NamedTuple):
    """A plan with where it came from."""

    sequence: str  # sides of the elbow at the start and along each side of the path, e.g. "+----"
    plan: Plan  # what it came to
    cost: float  # of the plan [m^2]


def sequences(start: str, lap_time: float, sides: int = 4) -> Iterator[tuple[str, list[Branch]]]:
    """Yield all sequences of branches that begin on a side of the elbow and change at the start and corners only."""
    for chosen in itertools.product(SIGNS, repeat=sides):
        branches = [Branch(0.0, start)]
        for n, side in enumerate(chosen):
            if side != branches[-1].side:
                straight = n * lap_time / sides
                branches.append(Branch(max(straight - 0.5 * CHANGE, 0.01), side, CHANGE))
        yield "".join(SIGNS[side] for side in (start, *chosen)), branches


def search(
    problem: TrackingProblem, task: SquareParameters, sides: int, effort: Effort, folder: Path, other: Plan | None
) -> list[Candidate]:
    """Find plans for a lap; trials and finals that the folder has with the same settings are reused.

    The elbow may change its side at the start of each of the path's sides. The best plan goes on as well on that of the
    arm's `other` lap, where its elbow is on the same side.

    Returns:
        The finalists, the best one first, then the others as their trials left them, without those that diverged; if
        all did, this is an error.
    """
    folder.mkdir(parents=True, exist_ok=True)
    found = []
    for sequence, branches in sequences(task.elbow_branch, task.lap_time, sides):
        start = partial(along, problem, branches)
        with suppress(DivergingStartError):
            found.append(improved(problem, sequence, start, effort.trial, folder / f"trial{sequence}.npz"))
    if not found:
        raise DivergingStartError(f"{folder.name}: the arm's state stays finite on no sequence of branches")
    found.sort(key=lambda one: one.cost)
    finals = []
    for one in found[: effort.finalists]:
        start = partial(Rollout, one.plan.states, one.plan.torques)
        file = folder / f"final{one.sequence}.npz"
        finals.append(improved(problem, one.sequence, start, effort.iterations, file))
    best = min(finals, key=lambda one: one.cost)
    split = round(GRAFT / problem.period)
    if other is not None and np.sign(best.plan.states[split, 1]) == np.sign(other.states[split, 1]):
        start, file = partial(grafted, problem, best.plan, other, split), folder / f"graft{best.sequence}.npz"
        finals.append(improved(problem, best.sequence, start, effort.iterations, file))
    return sorted(finals, key=lambda one: one.cost) + found[effort.finalists :]


def grafted(problem: TrackingProblem, own: Plan, other: Plan, split: int) -> Rollout:
    """Begin with a plan, and go on along another lap's from a period on, under its regulator.

    Some seconds after the start two laps are the same task, and the search may have found different optima.
    """
    references, gains = other.states[:-1].copy(), PlanRegulator(other).gains.copy()
    references[:, 0] += 2.0 * np.pi * np.round((own.states[split, 0] - other.states[split, 0]) / (2.0 * np.pi))
    gains[:split] = 0.0
    torques = np.concatenate([own.torques[:split], other.torques[split:]])
    return rollout(problem, torques, gains=gains, references=references)


def improved(
    problem: TrackingProblem, sequence: str, start: Callable[[], Rollout], iterations: int, path: Path
) -> Candidate:
    """Optimise from a start, or reuse the plan in its file."""
    own = {name: getattr(problem, name) for name in ("change_weight", "torque_weight", "deflection_limit")}
    settings = {"sequence": sequence, **own, "most_iterations": iterations}
    plan = _earlier(path, problem, settings)
    if plan is None:
        plan = Plan.of(problem, optimised(problem, start(), iterations, path.stem), **settings)
        put(path, plan.save)
    return Candidate(sequence, plan, plan.notes["log"]["cost"][-1])


def optimised(problem: TrackingProblem, start: Rollout, iterations: int, name: str) -> Solution:
    """Optimise from a start, with a progress bar of a name."""
    with tqdm(total=iterations, unit="iteration", desc=name, leave=False) as bar:

        def show(line: Iteration) -> None:
            bar.set_postfix_str(f"{line.cost:.4g} m^2, residual {line.residual:.1e}")
            bar.update()

        return optimise(problem, start, SolverOptions(iterations), show)


def _earlier(path: Path, problem: TrackingProblem, settings: dict[str, Any]) -> Plan | None:
    """Load a plan of an earlier run, if it is there and of these settings."""
    try:
        plan = Plan.load(path)
    except (FileNotFoundError, ValueError):  # none, damaged, or of another version: made anew
        return None
    return plan if solves(plan, problem, settings) else None
