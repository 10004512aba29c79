"""What keeps PPO's swing lap from the best plan's: starts, a curriculum, a teacher.

All agents are judged on `Square-v0` as it is registered.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from flexarm_agents import Spread
from flexarm_env.laps import SETTLED
from scripts.common.markdown import table
from scripts.common.plotting import BLUE, COLOURS, ORANGE, SOFT, WIDTH, headline, label_ends
from scripts.common.spreads import millimetres
from scripts.common.study import Study
from scripts.learning.agents import Agent, Agents, committed

ROWS = {  # the changes to the tuned settings of PPO at the time, which had no starts on the corners yet
    "plan_lqr": "best plan, true state (`plan_lqr`)",
    "student_gauges": "student (`student_gauges`)",
    "mix": "none: 30 % at rest on a corner, else moving",
    "corner": "at rest on the first corner, whole laps",
    "moving": "moving starts only",
    "slow": "curriculum: laps of 32 s for a third",
    "taught": "begins as `student_gauges`, value first, on the corners",
    "corners": "at rest on any corner (the registered settings)",
}
REWARDED = {
    "plan_lqr": ROWS["plan_lqr"],
    "student_gauges": ROWS["student_gauges"],
    "mix": "PPO, no change, median seed",
}
NOISES = (0.0, 0.1, 0.3)  # standard deviations of the noise on actions
DRAWN = {
    "plan_lqr": ("best plan", SOFT),
    "taught": ("PPO from the\nstudent's network", COLOURS[3]),
    "corners": ("PPO from rest\non the corners", BLUE),
    "mix": ("PPO from rest\nand moving", ORANGE),
}
STEP = 0.02  # [s], between two instants of the picture


def starts(agents: Agents) -> str:
    """Tabulate the laps of each agent's seeds; those that learned by reward also have the error at the end."""
    swing = ("swing: lap [mm]", "first 2 s [mm]", "after 2 s [mm]", "bends link 1 by [m]", "elbow straight at [s]")
    head = ("change", "seeds", "seeds that swing", *swing, "at the end of the training: lap [mm]", "plain: lap [mm]")
    return table(head, [_row(text, agents[name]) for name, text in ROWS.items()])


def _row(text: str, agent: Agent) -> tuple[str, ...]:
    swings = agent.measured("swing")
    errors = [Spread.of(one[name] for one in swings) for name in ("rms", "first", "later")]
    passed = Spread.of(one["passed"] for one in swings)
    return (
        text,
        agent.seeds,
        str(passed.complete),
        *map(millimetres, errors),
        f"{np.median([one['deflection'] for one in swings]):.2f}",
        "-" if passed.median is None else f"{passed.median:.2f}",
        millimetres(Spread.of(one["curve"]["swing"][-1] for one in agent.trainings)) if agent.config else "-",
        millimetres(Spread.of(one["rms"] for one in agent.measured("plain"))),
    )


def rewards(agents: Agents) -> str:
    """Tabulate what the reward makes of motions: does it prefer the best plan's, and with noise as well?"""
    rows = []
    for name, text in REWARDED.items():
        for lap, one in _median(agents[name]).items():
            noisy = (f"{value:.1f}" for value in one["noisy"])
            returns = f"{one['reward']:.0f}", f"{one['discounted']:.1f}"
            rows.append((text, lap, millimetres(one["first"]), *returns, *noisy))
    config = agents["mix"].config
    assert config is not None
    head = ("motion", "lap", "error, first 2 s [mm]", "reward of the lap", f"discounted by {config['gamma']:g}")
    return table((*head, *(f"first 2 s, noise {deviation:g}" for deviation in NOISES)), rows)


def picture(agents: Agents) -> Figure:
    """Draw error and deflection of link 1 over the first seconds of the swing lap, of some agents' median seeds."""
    figure, axes = plt.subplots(2, 1, figsize=(WIDTH, 6.2), sharex=True)
    for axis, name, scale in zip(axes, ("distances", "deflections"), (1e3, 1.0), strict=True):
        for agent, (_, colour) in DRAWN.items():
            values = scale * np.array(_median(agents[agent])["swing"][name])
            axis.plot(STEP * np.arange(len(values)), values, color=colour, linewidth=1.8)
    axes[0].set(ylabel="error [mm]", title="Distance of the tip from the target", ylim=(0.0, None))
    axes[1].set(ylabel="deflection [m]", title="Bend of link 1", xlabel="time since the start of the swing lap [s]")
    for axis in axes:
        axis.set_xlim(0.0, SETTLED)
    label_ends(axes[0], [*DRAWN.values()], [800.0 - 150.0 * n for n in range(len(DRAWN))])
    headline(figure, "The start of the swing lap: the best plan, and the median training of three ways of PPO")
    return figure


def _median(agent: Agent) -> Mapping[str, Any]:
    """Return the laps of the seed whose swing lap has the median error."""
    several: Sequence[Mapping[str, Any]] = [one["measured"] for one in agent.trainings]
    ranked = sorted(several, key=lambda laps: laps["swing"]["rms"] or np.inf)
    return ranked[(len(ranked) - 1) // 2]


STUDY = Study(
    "PPO's start of the swing lap: errors of seeds, median, middle mean, worst",
    committed("exploration"),
    {"exploration": starts, "exploration_rewards": rewards},
    {"agents/exploration": picture},
)
