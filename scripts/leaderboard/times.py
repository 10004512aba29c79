"""How long each entry takes to choose an action: measured apart from the cells, which are the same on every machine."""

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from flexarm_agents.board.entries import Entry
from flexarm_env.laps import LAPS
from flexarm_env.predictor import predictor
from scripts.common.markdown import span, table

PERIOD = 10.0  # [ms]
QUICK = 0.02  # of a period, below which entries share a line of the table
LAP = "plain"
FIRST = 10  # control periods that do not count: something may be made at the first call


def times(entries: Sequence[Entry], tick: Callable[[], Any]) -> dict[str, dict[str, float]]:
    """Time a lap of each entry: "median" and "p99" of the processor time from an observation to the action [ms]."""
    found = {}
    for entry in entries:
        candidate = entry.candidate(fresh=True)
        taken = period_times(candidate.env, candidate.policy)
        candidate.env.close()
        found[entry.name] = {"median": float(np.median(taken)), "p99": float(np.percentile(taken, 99.0))}
        tick()
    return found


def period_times(env: gymnasium.Env[Any, Any], policy: Any) -> NDArray[np.float64]:
    """Time each action of the plain lap but the first ones [ms]; where the path is lost, the lap begins anew.

    The time is that of this process alone, on all its cores (`time.process_time`): other work on the machine counts
    little.
    """
    predict, options = predictor(policy, deterministic=True), LAPS[LAP].reset_options()
    done, taken = True, list[float]()
    while len(taken) < env.get_wrapper_attr("lap_steps"):
        if done:
            observation, _ = env.reset(seed=0, options=options)
            memory, start = None, np.ones(1, dtype=bool)
        begun = time.process_time()
        action, memory = predict(observation, memory, start)
        taken.append(1e3 * (time.process_time() - begun))
        start = np.zeros(1, dtype=bool)
        observation, _, terminated, truncated, _ = env.step(action)
        done = bool(terminated or truncated)
    return np.array(taken[FIRST:])


def times_table(found: Mapping[str, Mapping[str, float]]) -> str:
    """Write the times, and what share of a control period the slowest hundredth takes; quick entries have one line."""
    ordered = sorted(found.items(), key=lambda item: item[1]["median"])
    rows = [
        [name, f"{one['median']:.3f}", f"{one['p99']:.3f}", _share(one["p99"])]
        for name, one in ordered
        if one["p99"] >= QUICK * PERIOD
    ]
    if quick := {name: one for name, one in ordered if one["p99"] < QUICK * PERIOD}:
        times, p99 = ([one[what] for one in quick.values()] for what in ("median", "p99"))
        rows.append(["all others", span(times, 3), f"up to {max(p99):.3f}", f"up to {_share(max(p99))}"])
    return table(["entry", "median [ms]", "99th percentile [ms]", "of the control period"], rows)


def _share(time: float) -> str:
    return f"{100.0 * time / PERIOD:.1f} %"
