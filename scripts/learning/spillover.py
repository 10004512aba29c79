"""Whether agents that learned on an arm of two shapes a link can drive arms with more, and the chain."""

from scripts.common.markdown import table
from scripts.common.study import Study
from scripts.learning.agents import Agents, committed

ARMS = ("2 shapes", "3 shapes", "4 shapes", "chain")
ROWS = {
    "lqg": "`lqg`, designed on three shapes",
    "student": "student on three shapes (`student`)",
    "fixed": "PPO, trained on two shapes",
    "drawn": "PPO, trained on two shapes, stiffness and damping drawn",
}


def errors(agents: Agents) -> str:
    """Tabulate the mean error of both laps on each arm."""
    rows = [
        (text, agents[name].seeds, *(agents[name].error_at(n) for n in range(len(ARMS)))) for name, text in ROWS.items()
    ]
    return table(("agent", "seeds", *(f"{arm} [mm]" for arm in ARMS)), rows)


STUDY = Study(
    "arms of more shapes than in training: mean r.m.s. error of both laps",
    committed("spillover", ("lqg", "student"), [("nominal" if arm == "chain" else "model", arm) for arm in ARMS]),
    {"spillover": errors},
)
