"""What first-order gradients learn through arm and sensor, beside PPO after as many steps and as many seconds."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from flexarm_agents import DescentConfig, NetworkPolicy, Spread, TrainingConfig
from flexarm_agents.board.references import references
from flexarm_agents.config import RunConfig
from flexarm_agents.descent.costs import costs
from flexarm_agents.descent.training import Descent
from flexarm_agents.layers import set_layers
from flexarm_agents.run_folder import RunFolder
from flexarm_agents.training import one_thread
from flexarm_env.envs.choices import DEFAULT_OBSERVATION
from flexarm_env.laps import LAPS
from scripts.common.curves import curve
from scripts.common.markdown import table
from scripts.common.spreads import spread_text
from scripts.common.trainings import Training
from scripts.learning.measured import seconds_per_million
from scripts.learning.study import Found, Study

GAUGES, LATE_TIP = ("modal_coordinates", "modal_rates"), ("sensor_error", "sensor_error_rate")
PPO = "ppo"
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
    "encoders": Way(
        "encoders and the late tip, four past actions",
        {"options": {"observation": without(*GAUGES), "last_actions": 4}},
    ),
    "encoders_longer": Way(
        "encoders and the late tip, eight past actions, twice as long",
        {"options": {"observation": without(*GAUGES), "last_actions": 8}, "rounds": 2 * DescentConfig.rounds},
    ),
    "state": Way("the true state: encoders and strain gauges", {"options": {"observation": without(*LATE_TIP)}}),
    "no_critic": Way("the registered observation, no critic, windows of 64", {"critic_epochs": 0, "horizon": 64}),
}


def agents() -> dict[str, RunConfig]:
    """Return the configurations; the windows of all have as many control periods."""
    common = DescentConfig()
    periods = common.windows * common.horizon
    found: dict[str, RunConfig] = {}
    for name, way in WAYS.items():
        windows = periods // int(way.settings.get("horizon", common.horizon))
        found[name] = DescentConfig(**{"windows": windows, **way.settings})
    return {**found, PPO: TrainingConfig()}


def best_until(training: Training, steps: float) -> dict[str, float | None]:
    """Return each lap's error at the best evaluation until then [m]; None for a lost lap.

    Args:
        training: finished.
        steps: of its environments.
    """
    known = curve(training)
    errors = [{lap: known[lap][n] for lap in LAPS} for n, done in enumerate(known["steps"]) if done <= steps]
    return min(errors, key=_mean)


def _mean(errors: Mapping[str, float | None]) -> float:
    return sum(float("inf") if error is None else error for error in errors.values()) / len(errors)


def tables(found: Found, folder: Path) -> Mapping[str, str]:
    """Write what each way comes to, PPO after as many steps and as many seconds; and how far derivatives reach."""
    head = ("learning", "observation", "seeds", "steps", "seconds of one core")
    laps = (cell for lap in LAPS for cell in (f"{lap} lap [m]", "times the plan"))
    made = {"gradients": table((*head, *laps), _lines(found, folder))}
    if "registered" in found:
        policy = NetworkPolicy.load(RunFolder(found["registered"][0].folder).last)
        rows = [(str(n), *(f"{first_action_slope(n, one):.3f}" for one in (None, policy))) for n in HORIZONS]
        made["gradient_horizons"] = table(("horizon [periods]", "untrained [m]", "trained [m]"), rows)
    return made


def first_action_slope(horizon: int, policy: NetworkPolicy | None) -> float:
    """Return the derivative of a window's costs by the first action [m]: its norm, the median over the arms.

    Args:
        horizon: control periods of the window, without a critic and undiscounted.
        policy: whose network drives, on the registered observation; None: an untrained one.
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
    """Return environment steps of a training by first-order gradients."""
    assert isinstance(config, DescentConfig)
    return config.rounds * config.steps


def _lines(found: Found, folder: Path) -> Iterator[tuple[str, ...]]:
    configs = agents()
    paid = {name: seconds_per_million(configs[name], folder / "costs" / f"{name}.json") for name in found}
    for name, way in WAYS.items():
        if name in found:
            yield _line("first-order gradients", way.text, found[name], all_steps(configs[name]), paid[name])
    if PPO in found:
        steps, text = all_steps(configs["registered"]), WAYS["registered"].text
        yield _line("PPO, as many steps", text, found[PPO], steps, paid[PPO])
        if "registered" in paid:
            fewer = int(steps * paid["registered"] / paid[PPO])
            yield _line("PPO, as many seconds", text, found[PPO], fewer, paid[PPO])


def _line(learning: str, seen: str, trainings: Sequence[Training], steps: int, paid: float) -> tuple[str, ...]:
    """Write a line; the median of the seeds is compared with the plan."""
    plans, best = references(), [best_until(one, steps) for one in trainings]
    cells = [learning, seen, str(len(trainings)), f"{steps:,}", f"{steps * paid / 1e6:.0f}"]
    for lap in LAPS:
        spread = Spread.of(one[lap] for one in best)
        times = "-" if spread.median is None else f"{spread.median / plans[lap]['rms']:.2f}"
        cells += [spread_text(spread, 4), times]
    return tuple(cells)


STUDY = Study(
    "first-order gradients beside PPO: r.m.s. error of the laps [m]; of seeds median, interquartile mean, worst",
    agents(),
    10,
    tables,
    ("gradients", "gradient_horizons"),
    partial=True,
    curves="gradients_curves",
)
