"""Whether algorithms with a replay buffer learn, beside PPO after as many steps and as many seconds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib import pyplot as plt

from flexarm_agents import TrainingConfig
from flexarm_agents.training.hyperparameters import ALGORITHMS
from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.common.plotting import COLOURS, WIDTH, headline, plain_ticks, plot_median, write
from scripts.common.spreads import millimetres
from scripts.learning.study import Agent, Records, Study

RESIDUAL, SQUARE = "SquareResidual-v0", "Square-v0"
PAIRS = {RESIDUAL: ("ppo", "sac", "tqc"), SQUARE: ("ppo", "sac", "tqc")}
LIKE = {RESIDUAL: 500_000, SQUARE: 1_000_000}  # steps of PPO
PICTURE = "off_policy.png"


class Line(NamedTuple):
    """What trainings of one algorithm on one environment came to.

    Attributes:
        algorithm: a name in `ALGORITHMS`.
        environment: its id without the namespace.
        config: of all of them.
        agent: what is known of them.
    """

    algorithm: str
    environment: str
    config: TrainingConfig
    agent: Agent

    def seconds(self, steps: int) -> float:
        """Return the processor time of some steps [s]."""
        assert self.agent.seconds is not None
        return 1e-6 * self.agent.seconds * steps


def config_of(environment: str, algorithm: str) -> TrainingConfig:
    """Return the configuration of an agent: the tuned settings.

    Args:
        environment: a name in `PAIRS`.
        algorithm: a name in `ALGORITHMS`.
    """
    own = TrainingConfig(environment=environment, algorithm=algorithm)  # type: ignore[arg-type]
    steps = own.steps if own.rollout is None else LIKE[environment]
    return replace(own, steps=steps, evaluate_every=steps // 10)


def updates(config: TrainingConfig) -> int:
    """Return how many steps of the optimisers a training has."""
    if config.epochs is not None:
        return config.steps * config.epochs // config.batch
    assert config.updates is not None and config.train_every is not None and config.learning_starts is not None
    return (config.steps - config.learning_starts) // (config.train_every * config.envs) * config.updates


def lines(agents: Records) -> list[Line]:
    """Return what was trained, in the order of the pairs."""
    return [
        Line(algorithm, environment, config_of(environment, algorithm), agents[name])
        for environment, algorithms in PAIRS.items()
        for algorithm in algorithms
        if (name := f"{environment}-{algorithm}") in agents
    ]


def tables(agents: Records, folder: Path) -> Mapping[str, str]:
    """Write the table, and draw the curves by steps and by seconds."""
    trained = lines(agents)
    draw(trained, folder / PICTURE)
    head = ("environment", "algorithm", "seeds", "steps", "updates", "minutes of one core")
    rows = [
        (
            f"`{line.environment}`",
            ALGORITHMS[line.algorithm].text,
            str(len(line.agent.trainings)),
            f"{line.config.steps:,}",
            f"{updates(line.config):,}",
            f"{line.seconds(line.config.steps) / 60:.1f}",
            *(millimetres(line.agent.spread(lap, "rms")) for lap in LAPS),
        )
        for line in trained
    ]
    return {"off_policy": table((*head, *(f"{lap} lap [mm]" for lap in LAPS)), rows)}


def draw(trained: Sequence[Line], path: Path) -> None:
    """Draw the mean error of both laps over steps and over seconds of one core, an environment in each row."""
    shown = [name for name in PAIRS if any(line.environment == name for line in trained)]
    size = (WIDTH, 1.4 + 2.8 * len(shown))
    figure, axes = plt.subplots(len(shown), 2, figsize=size, sharey=True, sharex="col", squeeze=False)
    for row, environment in zip(axes, shown, strict=True):
        for line in (line for line in trained if line.environment == environment):
            several = [one.curve for one in line.agent.trainings]
            count = min(len(one["steps"]) for one in several)
            steps = np.array(several[0]["steps"][:count])
            errors = [[_mean(one, k) for k in range(count)] for one in several]
            colour, label = COLOURS[list(ALGORITHMS).index(line.algorithm)], ALGORITHMS[line.algorithm].text
            for axis, x in zip(row, (1e-3 * steps, [line.seconds(step) for step in steps]), strict=True):
                plot_median(axis, x, errors, marker=".", color=colour, label=label)
        for axis, text in zip(row, ("by steps", "by time"), strict=True):
            axis.set(title=f"{environment}, {text}", yscale="log")
            plain_ticks(axis.yaxis)
        row[0].set_ylabel("mean error of both laps [mm]")
    axes[-1][0].set_xlabel("thousand environment steps")
    axes[-1][1].set_xlabel("processor time of one core [s]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=3)
    headline(figure, "Median of ten trainings, and best to worst while all complete both laps")
    write(figure, path)


def _mean(one: Mapping[str, Sequence[float | None]], n: int) -> float | None:
    """Return the mean error of both laps in an evaluation [m]; None if one was lost."""
    errors = [error for lap in LAPS if (error := one[lap][n]) is not None]
    return float(np.mean(errors)) if len(errors) == len(LAPS) else None


STUDY = Study(
    "SAC and TQC beside PPO: r.m.s. errors of the best evaluation",
    {
        f"{environment}-{algorithm}": config_of(environment, algorithm)
        for environment, algorithms in PAIRS.items()
        for algorithm in algorithms
    },
    10,
    tables,
    ("off_policy",),
    timed=True,
    picture=PICTURE,
    partial=True,
)
