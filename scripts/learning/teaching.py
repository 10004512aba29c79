"""What teaching is worth against reward and against gradients: errors by environment steps and by seconds."""

import json
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from flexarm_agents.board.terms import best_plans
from flexarm_agents.policies.load import POLICIES
from flexarm_env.laps import LAPS
from scripts.common.markdown import millimetres, table
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


def with_shipped(agents: Agents) -> Agents:
    """Add the shipped agents among the rows, from their cards and curves."""
    curves, found = json.loads((FOLDER / "curves.json").read_text()), dict(agents)
    for name in ROWS.keys() - agents.keys():
        card = json.loads((POLICIES / f"{name}.json").read_text())
        trainings = [
            {"seed": one["seed"], "best": one, "curve": curve, "measured": {}}
            for one, curve in zip(card["trainings"], curves[name], strict=True)
        ]
        rate = min(curve["seconds"][-1] / curve["steps"][-1] for curve in curves[name])  # the least busy machine's
        found[name] = Agent(card["config"], 1e6 * rate, trainings)
    return found


def learned(agents: Agents) -> str:
    """Tabulate the best evaluations beside the best plans, and what the trainings cost."""
    plans, rows = best_plans(), []
    for name, agent in ((name, with_shipped(agents)[name]) for name in ROWS):
        steps = agent.trainings[0]["curve"]["steps"][-1]
        cells = [agent.seeds, f"{steps:,}", "-" if agent.seconds is None else f"{1e-6 * steps * agent.seconds:.0f}"]
        for lap in LAPS:
            spread = agent.spread(lap)
            times = "-" if spread.median is None else f"{spread.median / plans[lap]['rms']:.2f}"
            cells += [millimetres(spread, 1), times]
        rows.append((*ROWS[name], *cells))
    laps = (cell for lap in LAPS for cell in (f"{lap} lap [mm]", "times the plan"))
    return table(("method", "the network reads", "seeds", "steps", "seconds of one core", *laps), rows)


def picture(agents: Agents) -> Figure:
    """Draw the mean error of both laps over steps and over seconds of one core, of the best evaluation so far."""
    figure, axes = plt.subplots(1, 2, figsize=(WIDTH, 4.4), sharey=True)
    whole, ends = with_shipped(agents), []
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


STUDY = Study(
    "what teaching is worth against reward and gradients: r.m.s. errors of the best evaluations",
    committed("teaching"),
    {"teaching": learned},
    {"agents/teaching": picture},
)
