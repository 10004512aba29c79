"""The best known runs of `FlexArm/Reach-v0`: for some seeds the motion that the episode draws is optimised."""

from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import flexarm_env  # noqa: F401  (registers the environments)
from flexarm_baselines.optimal import Branch, TrackingProblem, along
from flexarm_baselines.optimal.laps import OPTIONS
from flexarm_env.metrics.window import rms
from flexarm_env.rollout import run_policy
from flexarm_env.simulation.arm import FlexibleArm
from scripts.optimise.score import solved, tip_errors
from scripts.optimise.search import improved

PATH = "moves"  # name of its reference
SEEDS = tuple(range(8))
SIDE = "positive"  # of the elbow, as in the environment
ITERATIONS = 100


def problem_of(seed: int) -> TrackingProblem:
    """Return the problem of the episode that a seed draws."""
    with gymnasium.make("FlexArm/Reach-v0", error_limit=None) as env:
        # an arm at rest without torques stays; the reference is recorded
        run = run_policy(env, lambda observation: (0.0, 0.0), seed=seed)
    assert run.reference is not None
    return TrackingProblem(FlexibleArm(run.parameters), run.state[0], run.reference, **OPTIONS)


def best(seed: int, folder: Path) -> dict[str, Any]:
    """Optimise the episode of a seed; return errors over it and while the reference rests [m], efforts, the log.

    A plan that the folder has is reused.
    """
    folder.mkdir(parents=True, exist_ok=True)
    problem = problem_of(seed)
    start = partial(along, problem, [Branch(0.0, SIDE)])
    plan = improved(problem, SIDE, start, ITERATIONS, folder / f"{seed}.npz").plan
    away = tip_errors(plan)
    rests = np.all(plan.reference == np.roll(plan.reference, 1, axis=0), axis=1)
    return {
        "seed": seed,
        "true_tip_rms": rms(away),
        "true_tip_rms_at_rest": rms(away[rests]),
        "true_tip_max": float(away.max()),
        **solved(plan),
        "log": plan.notes["log"],
    }
