"""What first-order gradients learn through arm and sensor, with and without a search, beside PPO."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexarm_agents import DescentConfig, NetworkPolicy, Spread, TrainingConfig, load_policy
from flexarm_agents.board.references import references
from flexarm_agents.descent.costs import costs
from flexarm_agents.descent.training import Descent
from flexarm_agents.policies.load import POLICIES
from flexarm_agents.sb3.layers import set_layers
from flexarm_agents.training.config import RunConfig
from flexarm_agents.training.run_folder import RunFolder
from flexarm_agents.training.train import one_thread
from flexarm_env.envs.choices import DEFAULT_OBSERVATION
from flexarm_env.laps import LAPS
from scripts.common.markdown import table
from scripts.common.spreads import millimetres, spread_text
from scripts.learning.measured import seconds_per_million
from scripts.learning.study import Agent, Record, Records, Study

GAUGES, LATE_TIP = ("modal_coordinates", "modal_rates"), ("sensor_error", "sensor_error_rate")
HORIZONS = (8, 16, 32, 64)  # of windows whose derivatives are compared; an untrained arm is soon lost


def without(*blocks: str) -> list[str]:
    """Return the registered observation without some of its blocks."""
    return [name for name in DEFAULT_OBSERVATION if name not in blocks]


class Way(NamedTuple):
    """A way of learning.

    Attributes:
        text: what it is.
        settings: of its configuration.
    """

    text: str
    settings: Mapping[str, Any]


WAYS = {
    "registered": Way("the registered observation, late tip and strain gauges included", {}),
    "one": Way("the same; one candidate", {"candidates": 1}),
    "encoders": Way(
        "encoders and the late tip, four past actions",
        {"options": {"observation": without(*GAUGES), "last_actions": 4}},
    ),
    "state": Way(
        "the true state: encoders and strain gauges; one candidate",
        {"options": {"observation": without(*LATE_TIP)}, "candidates": 1},
    ),
}
PPO = "square"  # the shipped agent whose trainings stand beside


def agents() -> dict[str, RunConfig]:
    """Return the configurations."""
    return {name: DescentConfig(**way.settings) for name, way in WAYS.items()}


class Line(NamedTuple):
    """A row of the table.

    Attributes:
        learning: how.
        seen: what the policy observes.
        agent: what is known of it.
    """

    learning: str
    seen: str
    agent: Agent


def tables(agents: Records, folder: Path) -> Mapping[str, str]:
    """Write what each way comes to, beside PPO; and how far derivatives reach."""
    head = ("learning", "observation", "seeds", "steps", "seconds of one core")
    laps = (cell for lap in LAPS for cell in (f"{lap} lap [mm]", "times the plan"))
    rows = [_cells(line) for line in lines(agents, folder)]
    network = load_policy(PPO).policy
    assert isinstance(network, NetworkPolicy)
    slopes = [(str(n), *(f"{first_action_slope(n, one):.3f}" for one in (None, network))) for n in HORIZONS]
    return {
        "gradients": table((*head, *laps, "torque change, most [N m]"), rows),
        "gradient_horizons": table(("horizon [periods]", "untrained [m]", f"`{PPO}` [m]"), slopes),
    }


def first_action_slope(horizon: int, policy: NetworkPolicy | None) -> float:
    """Return the derivative of a window's costs by the first action [m]: its norm, the median over the arms.

    Args:
        horizon: control periods of the window, without a critic and undiscounted.
        policy: whose network drives, on the registered observation, of the sizes that `DescentConfig` has; None: an
            untrained one.
    """
    config = DescentConfig(horizon=horizon, critic_epochs=0, torque_noise=0.0, gamma=1.0)
    with one_thread():
        descent = Descent(config, RunFolder(config.folder))
        if policy is not None:
            set_layers(descent.learner.policy_network, policy)
            descent.driver.window(descent.learner.wanted, config.episode_steps)  # all arms are under way
        window = descent.driver.window(descent.learner.wanted, horizon)
        settings = descent.driver.env.settings
        gradients = descent.learner.gradients(window, costs(window, settings, config))
        descent.driver.env.close()
    whole = ~window.ended.any(axis=0)
    return float(np.median(np.linalg.norm(gradients[0, whole], axis=-1)))


def all_steps(config: RunConfig) -> int:
    """Return environment steps of a training.

    Args:
        config: of one by first-order gradients, or by reward.

    Raises:
        TypeError: for another kind of training.
    """
    if isinstance(config, DescentConfig):
        return config.all_rounds * config.steps
    if isinstance(config, TrainingConfig):
        return config.steps
    raise TypeError(f"config = {config!r}: must be a TrainingConfig or a DescentConfig")


def lines(agents: Records, folder: Path) -> list[Line]:
    """Return what the trainings of each way came to, and those of the shipped PPO agent."""
    made = [Line("first-order gradients", WAYS[name].text, agent) for name, agent in agents.items()]
    card = json.loads((POLICIES / f"{PPO}.json").read_text())
    config = TrainingConfig.of(card["config"])
    seconds = seconds_per_million(config, folder / "costs" / "ppo.json")
    trainings = [Record(one["seed"], one, {}, {}) for one in card["trainings"]]
    return [*made, Line(f"PPO (`{PPO}`)", WAYS["registered"].text, Agent(config, seconds, trainings))]


def _cells(line: Line) -> tuple[str, ...]:
    """Write a line; the median of the seeds is compared with the plan."""
    agent, plans = line.agent, references()
    assert agent.seconds is not None
    steps = all_steps(agent.config)
    cells = [line.learning, line.seen, str(len(agent.trainings)), f"{steps:,}", f"{steps * agent.seconds / 1e6:.0f}"]
    for lap in LAPS:
        spread = agent.spread(lap, "rms")
        times = "-" if spread.median is None else f"{spread.median / plans[lap]['rms']:.2f}"
        cells += [millimetres(spread, 1), times]
    changes = [_torque_change(one) for one in agent.trainings]
    return (*cells, "-" if None in changes else spread_text(Spread.of(changes), 1))


def _torque_change(one: Record) -> float | None:
    """Return the largest change of the torques [N m], of joints and laps; None where it was not kept, or a lap lost."""
    laps = [one.best[lap]["torque_change"] for lap in LAPS]
    return None if None in laps else float(max(map(max, laps)))


STUDY = Study(
    "first-order gradients beside PPO: r.m.s. error of the laps",
    agents(),
    10,
    tables,
    ("gradients", "gradient_horizons"),
    timed=True,
    partial=True,
)
