"""Mean errors of both laps under several conditions: sensors' delays, and arms that training did not have."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.common.plotting import COLOURS, SOFT, WIDTH, headline, plain_ticks
from scripts.common.study import Study
from scripts.learning.agents import Agents, committed

Rows = Mapping[str, Mapping[str, str]]  # what the table calls agents, by their group and their names in the data

DELAYS = (0, 10, 20, 31, 40, 50, 60, 70, 80, 90, 100, 110, 120)  # [ms]
OWN = 31  # of the default arm, rounded
SHOWN = {DELAYS.index(delay): f"{delay} ms" for delay in (0, OWN, 60, 90, 120)}  # of these, in tables
ARMS = dict(enumerate(("2 shapes", "3 shapes", "4 shapes", "chain")))
REMEDIES = {
    "none": "none",
    "actions": "last eight actions",
    "stacked": "past readings, up to 80 ms",
    "forecast": "past readings and a learned forecast",
    "recurrent": "recurrent (RecurrentPPO)",
    "observer": "Kalman filter in front",
    "inverse": "inverse model, shifted by 0.2 s, not PPO",
}
LATE: Rows = {  # by the delay in training or design
    "31 ms": {
        "lqg": "`lqg`",
        "student": "student (`student`)",
        **{f"known-{name}": text for name, text in REMEDIES.items()},
    },
    "0 to 60 ms": {
        "lqg_adaptive": "`lqg_adaptive`",
        "student_unknown": "student (`student_unknown`)",
        **{f"unknown-{name}": text for name, text in REMEDIES.items()},
    },
}
AS_POLICY, PRIVILEGED = "as much as the policy", "true state, delay and arm, too"
CRITIC: Rows = {
    "0 to 60 ms": {"unknown-stacked": AS_POLICY, "unknown-privileged": PRIVILEGED},
    "widens to 60 ms": {"unknown-automatic": PRIVILEGED},
    "0 to 120 ms": {"wide-stacked": AS_POLICY, "wide-privileged": PRIVILEGED},
    "widens to 120 ms": {"wide-automatic": PRIVILEGED},
}
SHAPES: Rows = {
    "3 shapes": {"lqg": "`lqg`", "student": "student (`student`)"},
    "2 shapes": {"fixed": "PPO", "drawn": "PPO, stiffness and damping drawn"},
}
LOOKS = (  # of the rows of `LATE`
    ("LQG; adaptive on the right", SOFT, "--"),
    ("student of a privileged controller", SOFT, ":"),
    ("PPO, no remedy", COLOURS[0], "-"),
    ("PPO, last eight actions", COLOURS[1], "-"),
    ("PPO, past readings up to 80 ms", COLOURS[2], "-"),
    ("PPO, past readings and a learned forecast", COLOURS[2], "--"),
    ("PPO, recurrent network", COLOURS[3], "-"),
    ("PPO, Kalman filter in front", COLOURS[4], "-"),
    ("inverse model, shifted by 0.2 s", COLOURS[0], ":"),
)


def errors(rows: Rows, what: tuple[str, str], shown: Mapping[int, str], agents: Agents) -> str:
    """Tabulate the mean error of both laps under the shown conditions, and what a training costs.

    `what` has the heads of group and agent, `shown` those of the conditions by their place in the data.
    """
    lines = []
    for group, own in rows.items():
        for name, text in own.items():
            agent = agents[name]
            seconds = "-" if agent.seconds is None else f"{agent.seconds:.0f}"
            lines.append((group, text, agent.seeds, seconds, *(agent.error_at(place) for place in shown)))
    return table((*what, "seeds", "seconds a million steps", *(f"{head} [mm]" for head in shown.values())), lines)


def picture(agents: Agents) -> Figure:
    """Draw the errors of both laps over the delay, of agents that learned at the known delay and at unknown ones."""
    figure, axes = plt.subplots(len(LAPS), len(LATE), figsize=(WIDTH, 7.4), sharex=True, sharey=True)
    for column, (trained, own) in zip(axes.T, LATE.items(), strict=True):
        for axis, lap in zip(column, LAPS, strict=True):
            for name, (label, colour, style) in zip(own, LOOKS, strict=True):
                look = {"label": label, "color": colour, "linestyle": style, "marker": "."}
                metres = np.array([one[lap] for one in agents[name].measured("errors")], float)
                axis.plot(DELAYS, 1e3 * np.median(np.nan_to_num(metres, nan=np.inf), axis=0), **look)
            axis.set(title=f"{lap} lap, trained at {trained}", yscale="log", ylim=(15.0, 2000.0))
            plain_ticks(axis.yaxis)
        column[-1].set_xlabel("delay of the sensor [ms]")
    for row in axes:
        row[0].set_ylabel("error of the lap, r.m.s. [mm]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=2)
    headline(figure, "What helps against a late sensor: medians of the trainings, while laps are complete")
    return figure


def _study(
    name: str, text: str, rows: Rows, what: tuple[str, str], shown: Mapping[int, str], data: str = "", **board: Any
) -> Study:
    pictures = {"agents/delays": picture} if rows is LATE else {}
    tables = {name: partial(errors, rows, what, shown)}
    return Study(f"{text}: mean r.m.s. error of both laps", committed(data or name, **board), tables, pictures)


STUDIES = {
    "delays": _study(
        "delays",
        "what helps against a late sensor",
        LATE,
        ("delay in training or design", "remedy"),
        SHOWN,
        beside=("lqg", "student", "lqg_adaptive", "student_unknown"),
        points=[("nominal", "square") if delay == OWN else ("delay", float(delay)) for delay in DELAYS],
    ),
    "critic": _study(
        "critic", "what a privileged critic is worth", CRITIC, ("delay in training", "the critic sees"), SHOWN, "delays"
    ),
    "shapes": _study(
        "shapes",
        "arms of more shapes than in training",
        SHAPES,
        ("trained or designed on", "agent"),
        ARMS,
        beside=("lqg", "student"),
        points=[("nominal" if arm == "chain" else "model", arm) for arm in ARMS.values()],
    ),
}
