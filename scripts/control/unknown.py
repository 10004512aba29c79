"""Controllers on arms that each episode draws anew."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import gymnasium
import numpy as np

from flexarm_baselines.registry import controller
from flexarm_baselines.task import Task
from flexarm_env.envs.registration import UNKNOWN_PLANT
from flexarm_env.laps import LAPS, SETTLED
from scripts.common.markdown import table
from scripts.common.study import Trial
from scripts.control.trials import cell, run_laps, study

ENVIRONMENT = "flexarm_env:FlexArm/Square-v0"
EPISODES = 256
Design = Callable[[Task], Mapping[str, Any]]  # returns keyword arguments of a controller's `for_env`


def run_unknown(
    name: str, design: Design = lambda task: {}, episodes: int = EPISODES
) -> dict[str, list[list[float] | None]]:
    """Run a controller of the registry in many episodes, every second one of which is a swing lap.

    Returns:
        By the lap, the errors of each episode over the lap and after 2 s [m]; None for a lost one.
    """
    entry = controller(name)
    envs = gymnasium.make_vec(ENVIRONMENT, num_envs=episodes, **entry.options | UNKNOWN_PLANT)
    policy = entry.make(envs, **design(Task.of(envs)))
    sides = [lap.elbow_branch for lap in LAPS.values()] * (episodes // len(LAPS))
    observations, infos = envs.reset(seed=0, options={"start": "corner", "elbow_branch": sides})
    squares, running, state = [infos["tip_error"] ** 2], np.ones(episodes, dtype=bool), None
    starting, over = np.ones(episodes, dtype=bool), np.zeros(episodes, dtype=bool)
    while not over.all():
        actions, state = policy.predict(observations, state, starting)
        observations, _, terminated, truncated, infos = envs.step(actions)
        starting, running = terminated | truncated, running & ~terminated
        squares.append(np.where(running, infos["tip_error"] ** 2, np.nan))
        over |= starting
    envs.close()
    parts = (np.array(squares), np.array(squares[round(SETTLED / 0.01) :]))
    pairs = np.stack([np.sqrt(np.mean(part, axis=0)) for part in parts], axis=1)
    kept = [None if np.isnan(pair).any() else pair.tolist() for pair in pairs]
    return {lap: kept[n :: len(LAPS)] for n, lap in enumerate(LAPS)}


def run_entry(name: str, episodes: int = EPISODES) -> dict[str, Any]:
    """Run a controller on both nominal laps, and on unknown arms."""
    return {"nominal": run_laps(name), "unknown": run_unknown(name, episodes=episodes)}


def field_table(results: Any) -> str:
    """Tabulate entries: both nominal laps, and all episodes on unknown arms, lost ones infinite."""
    lines = []
    for name, result in results.items():
        pairs = [pair for lap in LAPS for pair in result["unknown"][lap]]
        errors = np.sort([np.inf if pair is None else 1e3 * pair[0] for pair in pairs])
        shown = (errors[len(errors) // 2], errors[int(0.9 * len(errors))])
        lost = f"{np.sum(~np.isfinite(errors))} of {len(errors)}"
        figures = (f"{e:.0f}" if np.isfinite(e) else "lost" for e in shown)
        lines.append([f"`{name}`", *(cell(result["nominal"][lap], 1) for lap in LAPS), lost, *figures])
    head = ["entry", "swing lap [mm]", "plain lap [mm]", "unknown arms: lost", "median [mm]", "90th percentile [mm]"]
    return table(head, lines)


FEW = 32  # episodes of predictive controllers, which take a hundred times as long
FIELD: dict[str, Trial] = {
    **{name: partial(run_entry, name) for name in ("lqg", "lqg_imu", "hinf", "computed_torque", "computed_torque_dob")},
    **{name: partial(run_entry, name, FEW) for name in ("nmpc", "nmpc_deflection")},
}
FIELD_TEXT = "entries that the field expects: r.m.s. over the lap / after 2 s, and r.m.s. over the lap on unknown arms"
STUDIES = study(__name__, "field_entries", FIELD_TEXT, lambda: FIELD, field_table)
