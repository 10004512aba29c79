"""What teaching is worth against reward and against gradients: errors by environment steps and by seconds."""

import json
from collections.abc import Iterable
from itertools import product
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from flexarm_agents import Spread
from flexarm_agents.board.terms import best_plans
from flexarm_agents.policies.load import POLICIES
from flexarm_env.laps import LAPS
from scripts.common.markdown import millimetres, spread_text, table
from scripts.common.plotting import COLOURS, WIDTH, headline, label_ends, plain_ticks, plot_interquartile_mean
from scripts.common.study import Study
from scripts.learning.agents import FOLDER, Agent, Agents, committed

GAUGES, LATE = "encoders, late tip, strain gauges", "encoders, late tip"
ROWS = {  # method and observation; what the data of the study do not have is shipped
    "student_gauges": ("taught (DAgger; `student_gauges`)", GAUGES),
    "student": ("taught (DAgger; `student`)", LATE),
    "gradients": ("first-order gradients", GAUGES),
    "gradients-encoders": ("first-order gradients", LATE),
    "square": ("reward: PPO (`square`)", GAUGES),
    "mix": ("reward: PPO, half as long, starts anywhere", GAUGES),
    "sac": ("reward: SAC", GAUGES),
    "tqc": ("reward: TQC", GAUGES),
}
DRAWN = {
    "student_gauges": ("taught", COLOURS[0]),
    "gradients": ("gradients", COLOURS[1]),
    "square": ("PPO", COLOURS[2]),
    "sac": ("SAC", COLOURS[3]),
    "tqc": ("TQC", COLOURS[4]),
}


TASKS = {  # of agents that learn from the reward alone, by their names in the data
    "smooth": "`SmoothSquare-v0`",
    "unknown": "`SquareUnknown-v0`",
    "carry": "`Carry-v0`",
    "race": "`Race-v0`",
}
METHODS = {"ppo": "PPO", "sac": "SAC", "tqc": "TQC"}


def with_shipped(agents: Agents, names: Iterable[str]) -> Agents:
    """Add the shipped agents among some names, from their cards, and their curves where there are any."""
    every, found = json.loads((FOLDER / "curves.json").read_text()), dict(agents)
    for name in set(names) - agents.keys():
        card = json.loads((POLICIES / f"{name}.json").read_text())
        curves = every.get(name, [{}] * len(card["trainings"]))
        trainings = [
            {"seed": one["seed"], "best": one, "curve": curve, "measured": {}}
            for one, curve in zip(card["trainings"], curves, strict=True)
        ]
        timed = card["trainings"]
        if name in every:
            timed = [{what: curve[what][-1] for what in ("seconds", "steps")} for curve in curves]
        rate = min(one["seconds"] / one["steps"] for one in timed)  # the least busy machine's
        found[name] = Agent(card["config"], 1e6 * rate, trainings)
    return found


def learned(agents: Agents) -> str:
    """Tabulate the best evaluations beside the best plans, and what the trainings cost."""
    plans, whole, rows = best_plans(), with_shipped(agents, ROWS), []
    for name, agent in ((name, whole[name]) for name in ROWS):
        steps = agent.trainings[0]["curve"]["steps"][-1]
        cells = [agent.seeds, f"{steps:,}", "-" if agent.seconds is None else f"{1e-6 * steps * agent.seconds:.0f}"]
        for lap in LAPS:
            spread = agent.spread(lap)
            times = "-" if spread.median is None else f"{spread.median / plans[lap]['rms']:.2f}"
            cells += [millimetres(spread, 1), times]
        rows.append((*ROWS[name], *cells))
    laps = (cell for lap in LAPS for cell in (f"{lap} lap [mm]", "times the plan"))
    return table(("method", "the network reads", "seeds", "steps", "seconds of one core", *laps), rows)


def rewarded(agents: Agents) -> str:
    """Tabulate the best evaluations of agents that learn other tasks from the reward alone, and what that costs."""
    whole, rows = with_shipped(agents, ("race", "unknown")), []
    for task, method in product(TASKS, METHODS):
        agent = whole.get(f"{task}-{method}") or whole[task]
        assert agent.config is not None
        steps = agent.config["steps"]
        cost = "-" if agent.seconds is None else f"{1e-6 * steps * agent.seconds:.0f}"
        errors = ["-", "-", _reached(agent, "plain", "duration")]
        if task != "race":
            errors = [*(_reached(agent, lap, "rms") for lap in LAPS), "-"]
        rows.append((TASKS[task], METHODS[method], agent.seeds, f"{steps:,}", cost, *errors))
    laps = (f"{lap} lap [mm]" for lap in LAPS)
    return table(("on", "method", "seeds", "steps", "seconds of one core", *laps, "three laps [s]"), rows)


def _reached(agent: Agent, lap: str, figure: str) -> str:
    """Write the spread of a figure of the best evaluations; of lost ones the median time at which they were lost."""
    best = [one["best"][lap] for one in agent.trainings]
    spread = Spread.of(one[figure] if one["complete"] else None for one in best)
    if spread.median is None:
        return f"lost after {np.median([one['duration'] for one in best]):.1f} s"
    return millimetres(spread) if figure == "rms" else spread_text(spread, 2)


def picture(agents: Agents) -> Figure:
    """Draw the mean error of both laps over steps and over seconds of one core, of the best evaluation so far."""
    figure, axes = plt.subplots(1, 2, figsize=(WIDTH, 4.4), sharey=True)
    whole, ends = with_shipped(agents, ROWS), []
    for name, (_, colour) in DRAWN.items():
        agent = whole[name]
        assert agent.seconds is not None
        curves = [one["curve"] for one in agent.trainings]
        count = min(len(one["steps"]) for one in curves)
        steps = np.array(curves[0]["steps"][:count])
        means = [_best(one, count) for one in curves]
        for axis, x in zip(axes, (1e-3 * steps, 1e-6 * agent.seconds * steps), strict=True):
            end = plot_interquartile_mean(axis, x, means, marker=".", color=colour)
        ends.append(end)
    for axis, text in zip(axes, ("thousand environment steps", "processor time of one core [s]"), strict=True):
        axis.set(xscale="log", yscale="log", xlabel=text)
        plain_ticks(axis.xaxis)
        plain_ticks(axis.yaxis)
    axes[0].set_ylabel("mean error of both laps [mm]")
    label_ends(axes[-1], [*DRAWN.values()], ends)
    headline(figure, "Best evaluation so far of each method: interquartile mean of the seeds, interval of 95 %")
    return figure


def _best(curve: Any, count: int) -> Any:
    """Return the mean error of both laps of the best evaluation so far [m]; infinite while a lap was lost in each."""
    laps = np.array([curve[lap][:count] for lap in LAPS], dtype=float)
    return np.minimum.accumulate(np.nan_to_num(laps.mean(axis=0), nan=np.inf))


STUDIES = {
    "teaching": Study(
        "what teaching is worth against reward and gradients: r.m.s. errors of the best evaluations",
        committed("teaching"),
        {"teaching": learned},
        {"agents/teaching": picture},
    ),
    "reward": Study(
        "what reward alone reaches on other tasks: the best evaluations", committed("reward"), {"reward": rewarded}
    ),
}
