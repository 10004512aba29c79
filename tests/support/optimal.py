"""A problem of optimal motion that is solved in no time, its solution and plan, for the tests of both."""

from functools import cache
from typing import Any

import numpy as np

from flexarm_baselines.optimal import Plan, Solution, SolverOptions, TrackingProblem, optimise
from flexarm_env.simulation.feedback import Rollout
from tests.support.late_arm import ARM, SIZE, START

PERIODS = 25
IDLE = Rollout(np.zeros((PERIODS + 1, SIZE)), np.zeros((PERIODS, 2)))


def problem(**changes: Any) -> TrackingProblem:
    """Make the tip leave for a point that it cannot reach in time: torques come to their limits."""
    share = np.linspace(0.0, 1.0, PERIODS + 1)[:, None]
    reference = ARM.tip(START[:4]) + share * (-0.6, 0.5)
    options: dict[str, Any] = {"limits": (40.0, 12.0), "torque_weight": 1e-4, "change_weight": 1e-3}
    return TrackingProblem(ARM, START, reference, **(options | changes))


@cache
def solved() -> tuple[TrackingProblem, Solution]:
    case = problem()
    return case, optimise(case, IDLE, SolverOptions(tolerance=1e-7))


@cache
def plan() -> Plan:
    return Plan.of(*solved(), note="a test's")
