"""How little error costs how much effort: the best laps known for a range of weights on changes of the torques."""

from functools import partial
from pathlib import Path
from typing import Any

from flexarm_baselines.optimal import Plan, lap_problem
from flexarm_env.laps import SETTLED
from flexarm_env.metrics.window import rms
from flexarm_env.simulation.feedback import Rollout
from scripts.optimise.score import solved, tip_errors
from scripts.optimise.search import improved

WEIGHTS = (1e-1, 3e-2, 1e-2, 3e-3, 1e-3, 3e-4)  # [m^2]
ITERATIONS = 30  # of each weight at most; further ones change errors by less than a tenth of a millimetre


def curve(plan: Plan, lap: str, path: str, folder: Path) -> list[dict[str, Any]]:
    """Return error and effort for each weight, from that of a converged plan on upward and downward.

    Each search begins where the one for the weight before ended; plans that the folder has are reused. Errors are those
    of the plan's own states, which an environment repeats to rounding.
    """
    folder.mkdir(parents=True, exist_ok=True)
    own = plan.notes["change_weight"]
    upward = sorted(weight for weight in WEIGHTS if weight >= own)
    downward = sorted((weight for weight in WEIGHTS if weight < own), reverse=True)
    found = {}
    for weights in (upward, downward):
        last = plan
        for weight in weights:
            problem = lap_problem(plan.arm, lap, path=path, change_weight=weight)
            start = partial(Rollout, last.states, last.torques)
            last = improved(problem, "", start, ITERATIONS, folder / f"pareto{weight:g}.npz").plan
            found[weight] = _row(last, weight)
    return [found[weight] for weight in sorted(found)]


def _row(plan: Plan, weight: float) -> dict[str, Any]:
    """Collect the figures of a plan for a weight."""
    away = tip_errors(plan)
    return {
        "change_weight": weight,
        "true_tip_rms": rms(away),
        "true_tip_rms_after_2s": rms(away[plan.time >= SETTLED]),
        **solved(plan),
    }
