"""What learning adds to classical laws: torques, shifts of a reference, or the gain of the paper's law."""

from collections.abc import Mapping, Sequence

import numpy as np

from flexarm_agents import Spread
from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.common.spreads import millimetres, spread_text
from scripts.common.study import Study
from scripts.learning.agents import Agents, committed

ACTIONS = {
    "alone": "the joint-space law alone",
    "residual": "torques added to it, learned (PPO, 500,000 steps)",
    "reference": "shifts of its reference, learned (PPO, 500,000 steps)",
    "square": "no law: torques, learned (PPO, shipped `square`)",
}
PLANTS = {"square": "`SquareGain-v0`", "paper": "the paper's plant"}
SCHEDULES = {
    "-ifdc": "IFDC, gain 1",
    "-flsac": "FLSAC",
    "-constant": "best constant, {gain:g}",
    "": "learned (PPO, 500,000 steps)",
    "-foresight": "perfect foresight, 161 gains",
}
KNOTS = (11, 21, 41, 81, 161)  # gains of the schedules with perfect foresight, linear between them


def action_modes(agents: Agents) -> str:
    """Tabulate nominal laps and drawn arms; mean and worst are of the laps that are complete."""
    rows = []
    for name, text in ACTIONS.items():
        agent = agents[name]
        nominal = [millimetres(Spread.of(errors)) for errors in zip(*agent.measured("nominal"), strict=True)]
        rows.append((text, agent.seeds, *nominal, *_drawn(agent.measured("drawn"))))
    head = ("action", "seeds", *(f"{lap} lap [mm]" for lap in LAPS), "64 drawn plants: lost", "mean [mm]", "worst [mm]")
    return table(head, rows)


def _drawn(several: Sequence[Sequence[float | None]]) -> tuple[str, ...]:
    """Write how many drawn arms are lost, and mean and worst of the others."""
    complete = [[error for error in one if error is not None] for one in several]
    lost = [float(len(one) - len(errors)) for one, errors in zip(several, complete, strict=True)]
    means = [float(np.mean(errors)) if errors else None for errors in complete]
    worst = [max(errors, default=None) for errors in complete]
    return spread_text(Spread.of(lost), 0), millimetres(Spread.of(means)), millimetres(Spread.of(worst))


def schedulers(agents: Agents) -> str:
    """Tabulate each scheduler of the gain on each plant."""
    rows = []
    for plant, plant_text in PLANTS.items():
        for schedule, text in SCHEDULES.items():
            agent = agents[plant + schedule]
            measured: Mapping[str, float] = agent.trainings[0]["measured"]
            spreads = [agent.spread(lap, figure) for lap in LAPS for figure in ("rms", "rms_after_2s")]
            seeds = agent.seeds if agent.config else "-"
            rows.append((plant_text, text.format(**measured), seeds, *map(millimetres, spreads)))
    errors = [f"{lap}: {figure} [mm]" for lap in LAPS for figure in ("lap", "after 2 s")]
    return table(("plant", "scheduler", "seeds", *errors), rows)


def foresight(agents: Agents) -> str:
    """Tabulate the error with perfect foresight by the number of gains; first the best constant of the lap."""
    rows = [
        (text, lap, *map(millimetres, agents[f"{plant}-foresight"].measured(lap)[0]))
        for plant, text in PLANTS.items()
        for lap in LAPS
    ]
    return table(("plant", "lap", "constant", *(f"{count} gains" for count in KNOTS)), rows)


MODES = Study(
    "what learning adds to a joint-space law: r.m.s. error", committed("modes"), {"action_modes": action_modes}
)
SCHEDULERS = Study(
    "what scheduling the gain of the paper's law can give: r.m.s. error",
    committed("schedulers"),
    {"schedulers": schedulers, "foresight": foresight},
)
