"""What helps against a late sensor: nothing, past actions, past readings, a memory, or an observer in front."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

from matplotlib import pyplot as plt

from flexarm_agents import Spread, TrainingConfig
from flexarm_agents.board.columns import Point
from flexarm_agents.board.rows import Row
from flexarm_agents.policies.observer import FILTERED
from flexarm_env.envs.registration import IDS
from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.common.plotting import COLOURS, SOFT, WIDTH, headline, plain_ticks, plot_median, write
from scripts.common.spreads import millimetres
from scripts.learning.measured import Errors, errors_at, mean_of_laps, measure_at
from scripts.learning.study import Records, Study

STEPS = 1_000_000
DELAYS = (0, 10, 20, 31, 40, 50, 60, 70, 80, 90, 100, 110, 120)  # [ms]
SHOWN = (0, 31, 60, 90, 120)  # of these, in the table
POINTS = tuple(Point(float(delay), {"delay": 1e-3 * delay}) for delay in DELAYS)
TRAINED = {"known": "31 ms", "unknown": "0 to 60 ms"}
ENVIRONMENTS = {"known": "FlexArm/SquareDelayEasy-v0", "unknown": "FlexArm/SquareDelayMedium-v0"}
LATE = list(IDS["SquareDelayEasy-v0"].options["observation"])
OBSERVED = [*(name for name in LATE if not name.startswith("sensor_error")), *FILTERED]
REMEDIES = {
    "none": "none",
    "actions": "last eight actions",
    "stacked": "past readings, up to 80 ms",
    "recurrent": "recurrent (RecurrentPPO)",
    "observer": "Kalman filter in front",
}
YARDSTICKS = {
    "known": {"lqg": "`lqg`", "student": "student (`student`)"},
    "unknown": {"lqg_adaptive": "`lqg_adaptive`", "student_unknown": "student (`student_unknown`)"},
}
PICTURE = "delays.png"
LOOKS = (  # of the yardsticks' lines and the remedies'
    ("LQG; adaptive on the right", SOFT, "--"),
    ("student of a privileged controller", SOFT, ":"),
    ("PPO, no remedy", COLOURS[0], "-"),
    ("PPO, last eight actions", COLOURS[1], "-"),
    ("PPO, past readings up to 80 ms", COLOURS[2], "-"),
    ("PPO, recurrent network", COLOURS[3], "-"),
    ("PPO, Kalman filter in front", COLOURS[4], "-"),
)


class Line(NamedTuple):
    """A row of the table.

    Attributes:
        agent: its name; "": a yardstick.
        trained: a name in `TRAINED`.
        text: what it is.
        seconds: processor time of a million steps of a training [s]; None: it did not learn by reward.
        errors: of each seed.
    """

    agent: str
    trained: str
    text: str
    seconds: float | None
    errors: list[Errors]


def agents() -> dict[str, TrainingConfig]:
    """Return the configurations: each remedy at the known delay, then at the unknown one; those that take long last."""
    pairs = sorted(product(TRAINED, REMEDIES), key=lambda pair: pair[1] == "recurrent")
    return {f"{trained}-{remedy}": config_of(trained, remedy) for trained, remedy in pairs}


def config_of(trained: str, remedy: str) -> TrainingConfig:
    """Return the configuration of an agent.

    Args:
        trained: a name in `TRAINED`.
        remedy: a name in `REMEDIES`.
    """
    own: dict[str, Any] = {}
    options: dict[str, Any] = {"last_actions": 8 if remedy == "actions" else 1}
    if remedy == "stacked":
        own["lags"] = (1, 2, 3, 4, 6, 8)
    if remedy == "recurrent":
        own["algorithm"] = "recurrent_ppo"
    if remedy == "observer":
        own["observer"] = {"known": "nominal", "unknown": "delay"}[trained]
        options["observation"] = OBSERVED
    laps = {"known": 1, "unknown": 3}[trained]
    return TrainingConfig(
        environment=ENVIRONMENTS[trained],
        options=options,
        steps=STEPS,
        evaluate_every=STEPS // 10,
        evaluation_laps=laps,
        **own,
    )


def lines(agents: Records, folder: Path) -> Iterator[Line]:
    """Yield what was measured of the yardsticks and of each remedy."""
    for trained in TRAINED:
        for source, text in YARDSTICKS[trained].items():
            yield Line("", trained, text, None, [errors_at(Row(source), POINTS, folder / "cells")])
        for remedy, text in REMEDIES.items():
            name = f"{trained}-{remedy}"
            if name in agents:
                errors = [one.measured["errors"] for one in agents[name].trainings]
                yield Line(name, trained, text, agents[name].seconds, errors)


def tables(agents: Records, folder: Path) -> Mapping[str, str]:
    """Write the table, and draw the picture."""
    measured = list(lines(agents, folder))
    draw(measured, folder / PICTURE)
    head = (
        "delay in training or design",
        "remedy",
        "seeds",
        "steps",
        "seconds a million",
        *(f"{delay} ms [mm]" for delay in SHOWN),
    )
    rows = []
    for line in measured:
        means = [[mean_of_laps(one, DELAYS.index(delay)) for one in line.errors] for delay in SHOWN]
        errors = [millimetres(Spread.of(several)) for several in means]
        seconds = "-" if line.seconds is None else f"{line.seconds:.0f}"
        steps = f"{STEPS:,}" if line.agent else "-"
        rows.append((TRAINED[line.trained], line.text, str(len(line.errors)), steps, seconds, *errors))
    return {"delay_remedies": table(head, rows)}


def draw(measured: Sequence[Line], path: Path) -> None:
    """Draw the errors of both laps over the delay, of agents that learned at the known delay and at unknown ones."""
    figure, axes = plt.subplots(len(LAPS), len(TRAINED), figsize=(WIDTH, 7.4), sharex=True, sharey=True)
    for column, trained in zip(axes.T, TRAINED, strict=True):
        for axis, lap in zip(column, LAPS, strict=True):
            own = [line for line in measured if line.trained == trained]
            for line, (label, colour, style) in zip(own, LOOKS, strict=False):
                look = {"label": label, "color": colour, "linestyle": style, "marker": "."}
                plot_median(axis, DELAYS, [one[lap] for one in line.errors], band=False, **look)
            axis.set(title=f"{lap} lap, trained at {TRAINED[trained]}", yscale="log", ylim=(15.0, 2000.0))
            plain_ticks(axis.yaxis)
        column[-1].set_xlabel("delay of the sensor [ms]")
    for row in axes:
        row[0].set_ylabel("error of the lap, r.m.s. [mm]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=2)
    headline(figure, "What helps against a late sensor: medians of ten trainings, as far as they complete the lap")
    write(figure, path)


STUDY = Study(
    "what helps against a late sensor: mean r.m.s. error of both laps by the delay",
    agents(),
    11,
    tables,
    ("delay_remedies",),
    measure_at(POINTS),
    timed=True,
    picture=PICTURE,
    partial=True,
)
