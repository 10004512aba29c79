"""Whether algorithms with a replay buffer learn, beside PPO after as many steps and as many seconds."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.common.plotting import COLOURS, WIDTH, headline, plain_ticks, plot_median
from scripts.common.spreads import millimetres
from scripts.common.study import Study
from scripts.learning.agents import Agents, committed

ENVIRONMENTS = ("SquareResidual-v0", "Square-v0")
ALGORITHMS = {"ppo": ("PPO", COLOURS[0]), "sac": ("SAC", COLOURS[2]), "tqc": ("TQC", COLOURS[3])}


def updates(config: Mapping[str, Any]) -> int:
    """Return how many steps of the optimisers a training has."""
    if config["epochs"] is not None:
        return config["steps"] * config["epochs"] // config["batch"]
    return (config["steps"] - config["learning_starts"]) // (config["train_every"] * config["envs"]) * config["updates"]


def learned(agents: Agents) -> str:
    """Tabulate the best evaluations, and what the trainings cost."""
    head = ("environment", "algorithm", "seeds", "steps", "updates", "minutes of one core")
    rows = []
    for environment in ENVIRONMENTS:
        for algorithm, (text, _) in ALGORITHMS.items():
            agent = agents[f"{environment}-{algorithm}"]
            assert agent.config is not None
            assert agent.seconds is not None
            minutes = 1e-6 * agent.seconds * agent.config["steps"] / 60
            cost = (f"{agent.config['steps']:,}", f"{updates(agent.config):,}", f"{minutes:.1f}")
            errors = [millimetres(agent.spread(lap)) for lap in LAPS]
            rows.append((f"`{environment}`", text, agent.seeds, *cost, *errors))
    return table((*head, *(f"{lap} lap [mm]" for lap in LAPS)), rows)


def picture(agents: Agents) -> Figure:
    """Draw the mean error of both laps over steps and over seconds of one core, an environment in each row."""
    size = (WIDTH, 1.4 + 2.8 * len(ENVIRONMENTS))
    figure, axes = plt.subplots(len(ENVIRONMENTS), 2, figsize=size, sharey=True, sharex="col")
    for row, environment in zip(axes, ENVIRONMENTS, strict=True):
        for algorithm, (label, colour) in ALGORITHMS.items():
            agent = agents[f"{environment}-{algorithm}"]
            assert agent.seconds is not None
            curves = [one["curve"] for one in agent.trainings]
            count = min(len(one["steps"]) for one in curves)
            steps = np.array(curves[0]["steps"][:count])
            means = [[_mean(one, n) for n in range(count)] for one in curves]
            for axis, x in zip(row, (1e-3 * steps, [1e-6 * agent.seconds * step for step in steps]), strict=True):
                plot_median(axis, x, means, marker=".", color=colour, label=label)
        for axis, text in zip(row, ("by steps", "by time"), strict=True):
            axis.set(title=f"{environment}, {text}", yscale="log")
            plain_ticks(axis.yaxis)
        row[0].set_ylabel("mean error of both laps [mm]")
    axes[-1][0].set_xlabel("thousand environment steps")
    axes[-1][1].set_xlabel("processor time of one core [s]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    headline(figure, "Median of ten trainings, and best to worst while all complete both laps")
    return figure


def _mean(curve: Mapping[str, Sequence[float | None]], n: int) -> float | None:
    """Return the mean error of both laps in an evaluation [m]; None if one was lost."""
    errors = [error for lap in LAPS if (error := curve[lap][n]) is not None]
    return float(np.mean(errors)) if len(errors) == len(LAPS) else None


STUDY = Study(
    "SAC and TQC beside PPO: r.m.s. errors of the best evaluation",
    committed("off_policy"),
    {"off_policy": learned},
    {"agents/off_policy": picture},
)
