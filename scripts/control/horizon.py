"""How far ahead `nmpc_adaptive` looks: what shorter horizons lose on unknown arms, and how far they err."""

from functools import partial
from typing import Any

from flexarm_baselines.predictive import NMPC
from flexarm_baselines.registry import controller
from scripts.common.markdown import table
from scripts.common.study import study
from scripts.control.robust import LOSSES, losses, run_unknown
from scripts.control.trials import ERRORS, cell, run_laps

NAME, EPISODES = "nmpc_adaptive", 128
HORIZONS = (0.1, 0.2, 0.3, 0.5)  # [s]


def run_horizon(horizon: float) -> dict[str, Any]:
    """Return the scores on the nominal laps, and the errors of `run_unknown`, of a horizon [s]."""
    one = controller(NAME)
    errors = run_unknown(partial(NMPC.for_env, horizon=horizon, **one.design), one.options, EPISODES)
    return {"nominal": run_laps(NAME, {"horizon": horizon}), "unknown": errors}


def horizon_table(results: Any) -> str:
    """Tabulate errors on the nominal laps, and losses and errors on unknown arms."""
    rows = results.items()
    lines = [[name, *(cell(lap, 1) for lap in one["nominal"].values()), *losses(one["unknown"])] for name, one in rows]
    return table(["horizon [s]", *ERRORS, *(f"unknown arms: {text}" for text in LOSSES)], lines)


STUDIES = study(
    __name__,
    "horizon",
    "predictive control by the length of its prediction",
    lambda: {f"{horizon:g}": partial(run_horizon, horizon) for horizon in HORIZONS},
    horizon_table,
)
