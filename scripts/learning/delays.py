"""What helps against a late sensor: nothing, past actions, past readings, a memory, or an observer in front."""

from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.common.plotting import COLOURS, SOFT, WIDTH, headline, plain_ticks, plot_median
from scripts.common.study import Study
from scripts.learning.agents import Agents, committed

DELAYS = (0, 10, 20, 31, 40, 50, 60, 70, 80, 90, 100, 110, 120)  # [ms]
OWN = 31  # of the default arm, rounded
SHOWN = (0, OWN, 60, 90, 120)  # of these, in the table
REMEDIES = {
    "none": "none",
    "actions": "last eight actions",
    "stacked": "past readings, up to 80 ms",
    "recurrent": "recurrent (RecurrentPPO)",
    "observer": "Kalman filter in front",
}
ROWS = {  # by the delay in training or design
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
LOOKS = (  # of the rows
    ("LQG; adaptive on the right", SOFT, "--"),
    ("student of a privileged controller", SOFT, ":"),
    ("PPO, no remedy", COLOURS[0], "-"),
    ("PPO, last eight actions", COLOURS[1], "-"),
    ("PPO, past readings up to 80 ms", COLOURS[2], "-"),
    ("PPO, recurrent network", COLOURS[3], "-"),
    ("PPO, Kalman filter in front", COLOURS[4], "-"),
)


def remedies(agents: Agents) -> str:
    """Tabulate the mean error of both laps by the delay, and what a training costs."""
    head = ("delay in training or design", "remedy", "seeds", "steps", "seconds a million")
    rows = []
    for trained, own in ROWS.items():
        for name, text in own.items():
            agent = agents[name]
            steps = f"{agent.config['steps']:,}" if agent.config else "-"
            seconds = "-" if agent.seconds is None else f"{agent.seconds:.0f}"
            errors = [agent.error_at(DELAYS.index(delay)) for delay in SHOWN]
            rows.append((trained, text, agent.seeds, steps, seconds, *errors))
    return table((*head, *(f"{delay} ms [mm]" for delay in SHOWN)), rows)


def picture(agents: Agents) -> Figure:
    """Draw the errors of both laps over the delay, of agents that learned at the known delay and at unknown ones."""
    figure, axes = plt.subplots(len(LAPS), len(ROWS), figsize=(WIDTH, 7.4), sharex=True, sharey=True)
    for column, (trained, own) in zip(axes.T, ROWS.items(), strict=True):
        for axis, lap in zip(column, LAPS, strict=True):
            for name, (label, colour, style) in zip(own, LOOKS, strict=True):
                look = {"label": label, "color": colour, "linestyle": style, "marker": "."}
                plot_median(axis, DELAYS, [one[lap] for one in agents[name].measured("errors")], band=False, **look)
            axis.set(title=f"{lap} lap, trained at {trained}", yscale="log", ylim=(15.0, 2000.0))
            plain_ticks(axis.yaxis)
        column[-1].set_xlabel("delay of the sensor [ms]")
    for row in axes:
        row[0].set_ylabel("error of the lap, r.m.s. [mm]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower left", ncols=2)
    headline(figure, "What helps against a late sensor: medians of ten trainings, as far as they complete the lap")
    return figure


STUDY = Study(
    "what helps against a late sensor: mean r.m.s. error of both laps by the delay",
    committed(
        "delays",
        ("lqg", "student", "lqg_adaptive", "student_unknown"),
        [("nominal", "square") if delay == OWN else ("delay", float(delay)) for delay in DELAYS],
    ),
    {"delay_remedies": remedies},
    {"agents/delays": picture},
)
