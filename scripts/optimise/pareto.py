"""How little error costs how much effort: the best laps known for a range of weights on changes of the torques."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from flexarm_baselines.optimal import Iteration, Plan, SolverOptions, lap_problem, optimise
from scripts.optimise.score import efforts

WEIGHTS = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4)  # [m^2]
ITERATIONS = 100  # of each weight at most


def curve(plan: Plan, lap: str, tick: Callable[[str, Iteration | None], Any]) -> list[dict[str, Any]]:
    """Return error and effort for each weight; each search begins where the one before ended.

    Errors are those of the plan's own states, which an environment repeats to rounding.

    Args:
        plan: to begin with, a converged one.
        lap: its name.
        tick: called after each iteration.
    """
    problem, run, rows = lap_problem(plan.arm, lap), plan.replay(), []
    for weight in sorted(WEIGHTS):
        changed = replace(problem, change_weight=weight)
        found = optimise(changed, run, SolverOptions(ITERATIONS), lambda line, w=weight: tick(f"{w:g}", line))  # type: ignore[misc]
        run = found.run
        reached = Plan.of(changed, found)
        away = np.linalg.norm(plan.arm.tip(run.states[:, : plan.arm.size]) - plan.reference, axis=1)
        rows.append(
            {
                "change_weight": weight,
                "true_tip_rms": float(np.sqrt(np.mean(away**2))),
                "true_tip_rms_after_2s": float(np.sqrt(np.mean(away[plan.time >= 2.0] ** 2))),
                **efforts(reached),
                "converged": found.converged,
                "residual": found.log[-1].residual,
            }
        )
    return rows
