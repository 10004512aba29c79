"""Races on unknown arms: how slow a plan must be, and what an entry makes of the plan that comes with the package."""

from functools import partial
from typing import Any

import gymnasium
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.figure import Figure

from flexarm_baselines.lqg.race import race_plan
from flexarm_baselines.registry import controller
from flexarm_env.envs.registration import UNKNOWN_PLANT
from scripts.common.command_line import run
from scripts.common.markdown import table
from scripts.common.plotting import BLUE, ORANGE, WIDTH
from scripts.common.study import Trial, command, study
from scripts.optimise.race import Race, steady

ARMS = 32  # for a plan
ENTRIES = {"race_lqg": 32, "race_lqg_adaptive": 256, "race_mpcc": 32}
SLOWER = (1.2, 1.3)  # of plans; that of the package is 1.4 times slower
PRICES = (0.005, 0.01)  # of `race_mpcc`; its own is half of the first
SEED = 5000  # of the first arm; the board's seeds are hashes


def run_races(name: str, arms: int, slower: float | None = None, **design: Any) -> dict[str, Any]:
    """Run an entry on unknown arms, along its own plan or one that is so many times slower than the fastest.

    Return the plan's times and largest error, and for each arm the time of the three laps [s], None for a lost race.
    """
    entry = controller(name)
    if slower is not None:
        design["plan"] = steady(Race(), slower)
    plan = design.get("plan") or race_plan(entry.design.get("plan", "default"))
    envs = gymnasium.make_vec(f"flexarm_env:{entry.environment}", num_envs=arms, **entry.options | UNKNOWN_PLANT)
    policy = entry.make(envs, **design)
    observations, _ = envs.reset(seed=SEED)
    over, starting, state = np.zeros(arms, dtype=bool), np.ones(arms, dtype=bool), None
    times: list[float | None] = [None] * arms
    while not over.all():
        actions, state = policy.predict(observations, state, starting)
        observations, _, terminated, truncated, infos = envs.step(actions)
        starting = terminated | truncated
        for n in np.flatnonzero(starting & ~over):
            times[n] = float(infos["lap_times"][n, 2]) or None
        over |= starting
    envs.close()
    return {"plan": plan.notes["lap_times"], "largest_error": plan.notes["largest_error"], "times": times}


def _trials() -> dict[str, Trial]:
    plans = {f"{slower:g}": partial(run_races, "race_lqg_adaptive", ARMS, slower) for slower in SLOWER}
    prices = {f"race_mpcc, price {price:g}": partial(run_races, "race_mpcc", ARMS, price=price) for price in PRICES}
    return {**plans, **{name: partial(run_races, name, arms) for name, arms in ENTRIES.items()}, **prices}


def _lost(one: Any) -> int:
    return sum(time is None for time in one["times"])


def _median(one: Any) -> float:
    return float(np.median([np.inf if time is None else time for time in one["times"]]))


def race_table(results: Any) -> str:
    """Tabulate plans that are slower and slower, and entries along their own."""
    lines = []
    for name, one in results.items():
        kind, _, price = name.partition(", ")
        own = f"`{kind}`{price and f', {price}'}"
        entry = own if kind in ENTRIES else f"`race_lqg_adaptive`, plan {name} times slower"
        median = f"{_median(one):.2f}" if np.isfinite(_median(one)) else "lost"
        plan = f"{one['plan'][2]:.2f}", f"{1e3 * one['largest_error']:.0f}"
        lines.append([entry, *plan, f"{_lost(one)} of {len(one['times'])}", median])
    return table(["entry", "its plan [s]", "off by at most [mm]", "unknown arms: lost", "median [s]"], lines)


def race_picture(results: Any) -> Figure:
    """Draw the share of lost races against the plan's time."""
    figure, axis = plt.subplots(figsize=(WIDTH, 3.2))
    plans = [results[f"{slower:g}"] for slower in SLOWER] + [results["race_lqg_adaptive"]]
    share = [100.0 * _lost(one) / len(one["times"]) for one in plans]
    axis.plot([one["plan"][2] for one in plans], share, "o-", color=BLUE)
    for one, lost in zip(plans, share, strict=True):
        text = f"{1e3 * one['largest_error']:.0f} mm"
        axis.annotate(text, (one["plan"][2], lost), (8, 8), textcoords="offset points", color=ORANGE)
    axis.set(xlabel="the plan's time for three laps [s]; by how much it is off at most", ylabel="lost [%]")
    axis.set(ylim=(-3.0, 1.15 * max(share) + 5.0), xlim=(21.0, 26.0))
    return figure


STUDIES = study(__name__, "race_unknown", "races on unknown arms: three laps", _trials, race_table, race_picture)


if __name__ == "__main__":
    run(lambda: command("optimise.race_study", STUDIES, "Compare plans of a race on unknown arms."))
