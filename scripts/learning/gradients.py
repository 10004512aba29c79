"""What first-order gradients learn through arm and sensor, with and without a search, beside PPO."""

import json
from typing import Any

from flexarm_agents import Spread
from flexarm_agents.board.terms import best_plans
from flexarm_agents.policies.load import POLICIES
from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.common.spreads import millimetres, spread_text
from scripts.common.study import Study
from scripts.learning.agents import Agent, Agents, committed

REGISTERED = "the registered observation, late tip and strain gauges included"
ROWS = {
    "registered": REGISTERED,
    "one": "the same; one candidate",
    "encoders": "encoders and the late tip, four past actions",
    "state": "the true state: encoders and strain gauges; one candidate",
}
PPO = "square"  # the shipped agent beside them
HORIZONS = (8, 16, 32, 64)  # [control periods], of windows whose derivatives were compared


def errors(agents: Agents) -> str:
    """Tabulate what each observation comes to, beside PPO."""
    head = ("learning", "observation", "seeds", "steps", "seconds of one core")
    laps = (cell for lap in LAPS for cell in (f"{lap} lap [mm]", "times the plan"))
    rows = [
        ("first-order gradients", text, *_cells(agents[name], agents[name].trainings[0]["curve"]["steps"][-1]))
        for name, text in ROWS.items()
    ]
    card = json.loads((POLICIES / f"{PPO}.json").read_text())
    shipped = agents[PPO]._replace(trainings=[{"best": one} for one in card["trainings"]])
    rows.append((f"PPO (`{PPO}`)", REGISTERED, *_cells(shipped, card["config"]["steps"])))
    return table((*head, *laps, "torque change, most [N m]"), rows)


def _cells(agent: Agent, steps: int) -> tuple[str, ...]:
    """Write the cells of an agent; the median of its seeds is compared with the plan."""
    assert agent.seconds is not None
    cells, plans = [agent.seeds, f"{steps:,}", f"{steps * agent.seconds / 1e6:.0f}"], best_plans()
    for lap in LAPS:
        spread = agent.spread(lap)
        times = "-" if spread.median is None else f"{spread.median / plans[lap]['rms']:.2f}"
        cells += [millimetres(spread, 1), times]
    changes = [_torque_change(one["best"]) for one in agent.trainings]
    return (*cells, "-" if None in changes else spread_text(Spread.of(changes), 1))


def _torque_change(best: dict[str, Any]) -> float | None:
    """Return the largest change of the torques [N m], of joints and laps; None if a lap was lost."""
    laps = [best[lap]["torque_change"] for lap in LAPS]
    return None if None in laps else float(max(map(max, laps)))


def horizons(agents: Agents) -> str:
    """Tabulate the derivative of a window's costs by its first action [m], by the window's length."""
    slopes = [agents[name].measured("slopes")[0] for name in ("untrained", PPO)]
    rows = [(str(length), *(f"{one[n]:.3f}" for one in slopes)) for n, length in enumerate(HORIZONS)]
    return table(("horizon [periods]", "untrained [m]", f"`{PPO}` [m]"), rows)


STUDY = Study(
    "first-order gradients beside PPO: r.m.s. error of the laps",
    committed("gradients"),
    {"gradients": errors, "gradient_horizons": horizons},
)
