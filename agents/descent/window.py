"""`Window`: what a batch of arms went through over some control periods; `Driver`: what runs it; `costs`: of periods.

The terms of a cost are metres: the tip's distance from the reference, smooth where it is 0; changes of the actions;
deflections near those that end an episode; and outputs of the network beyond the largest action, where nothing else has
a slope.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.descent.config import FOPGConfig
from flexarm_env.envs.settings import Settings
from flexarm_env.envs.vector import FlexArmVectorEnv
from flexarm_env.simulation.open_loop import LARGEST

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Flags = NDArray[np.bool_]
Network = Callable[[Singles], NDArray[np.floating]]


class Window(NamedTuple):
    """T control periods of n arms. Instant t is the beginning of period t; the last one is the end of the last period.

    At an instant at which an episode begins, all is that of the new one.
    """

    observations: Singles  # at each instant. Shape (T + 1, n, k)
    states: Floats  # at each instant. Shape (T + 1, n, 4 + 4 m)
    readings: Floats  # latest ones of the sensor on link 2 [m]. Shape (T + 1, n, 2)
    ages: NDArray[np.int64]  # control periods since the episode began. Shape (T + 1, n)
    output: Floats  # of the network, disturbed. Shape (T, n, 2)
    actions: Singles  # the output, limited to [-1, 1]. Shape (T, n, 2)
    earlier: Singles  # action of the period before, 0 where an episode begins. Shape (T, n, 2)
    # States at the ends of the periods, of the episodes that end there; of an arm that flew apart, the one before.
    # Shape (T, n, 4 + 4 m)
    after: Floats
    references: Floats  # where the tip should be then [m]. Shape (T, n, 2)
    last: Singles  # observations then. Shape (T, n, k)
    ended: Flags  # the episode ends with the period. Shape (T, n)
    lost: Flags  # and not because of its time limit. Shape (T, n)


def usable(states: Floats, before: Floats) -> Floats:
    """Return states; of arms that flew apart, whose episode ends there, those before. Shape (..., 4 + 4 m)."""
    whole = (np.abs(states) <= LARGEST).all(axis=-1, keepdims=True)
    return np.where(whole, states, before)


class Driver:
    """A batch that runs window after window; between two it can be pickled."""

    def __init__(self, env: FlexArmVectorEnv, seed: int, noise: float = 0.0) -> None:
        """Begin episodes.

        Args:
            env: the batch; an episode begins in the step that ends the one before.
            seed: of the episodes, and of the disturbance of the actions.
            noise: standard deviation of the disturbance for the last arm, in actions; it is proportional to the arm's
                number, from 1.
        """
        self.env = env
        self._random = np.random.default_rng(seed)
        self._noise = noise * np.linspace(0.0, 1.0, env.num_envs + 1)[1:, None]
        self._observations, infos = env.reset(seed=seed)
        self._states, self._readings = infos["state"].copy(), infos["sensed"].copy()
        self._ages = np.zeros(env.num_envs, dtype=np.int64)
        self._earlier = np.zeros((env.num_envs, 2), dtype=np.float32)

    def stagger(self, periods: int) -> None:
        """Begin the arms' episodes one after the other, with no action but the disturbance, so that their ages differ.

        Args:
            periods: control periods over which the beginnings are spread.
        """
        count = len(self._ages)
        turns = np.arange(count) * periods // count
        for turn in range(periods):
            if (mask := turns == turn).any():
                self._observations, infos = self.env.reset(options={"reset_mask": mask})
                some = mask[:, None]
                self._states = np.where(some, infos["state"], self._states)
                self._readings = np.where(some, infos["sensed"], self._readings)
                self._earlier = np.where(some, np.float32(0.0), self._earlier)
                self._ages = np.where(mask, 0, self._ages)
            self.window(lambda seen: np.zeros((count, 2)), 1)

    def window(self, network: Network, periods: int) -> Window:
        """Run a window."""
        instants, done = [self._instant()], []
        for _ in range(periods):
            output = network(self._observations) + self._noise * self._random.normal(size=self._earlier.shape)
            actions, earlier = np.clip(output, -1.0, 1.0).astype(np.float32), self._earlier
            self._observations, _, lost, cut, infos = self.env.step(actions)
            ended = lost | cut
            after, references, last = infos["state"].copy(), infos["reference"].copy(), self._observations
            if ended.any():
                final, last = infos["final_info"], last.copy()
                after[ended], references[ended] = final["state"][ended], final["reference"][ended]
                last[ended] = np.stack(list(infos["final_obs"][ended]))
                after = usable(after, self._states)
            self._states, self._readings = infos["state"], infos["sensed"]
            self._ages = np.where(ended, 0, self._ages + 1)
            self._earlier = np.where(ended[:, None], np.float32(0.0), actions)
            done.append((output, actions, earlier, after, references, last, ended, lost))
            instants.append(self._instant())
        at, over = (map(np.stack, zip(*rows, strict=True)) for rows in (instants, done))
        return Window(*at, *over)

    def _instant(self) -> tuple[Singles, Floats, Floats, NDArray[np.int64]]:
        return self._observations, self._states, self._readings, self._ages


class Costs(NamedTuple):
    """Costs of the periods of a window."""

    total: Floats  # Shape (T, n)
    by_after: Floats  # derivatives by the states at the ends of the periods. Shape (T, n, 4 + 4 m)
    by_output: Floats  # by the network's output, apart from the action. Shape (T, n, 2)
    by_action: Floats  # by the action, and with the other sign by that of the period before. Shape (T, n, 2)
    errors: Floats  # distances of the tip from the reference at the ends of the periods [m]. Shape (T, n)


def costs(window: Window, settings: Settings, config: FOPGConfig) -> Costs:
    """Compute costs and derivatives."""
    values, slopes = settings.flexible_arm.output_jacobians(window.after)
    away = values.true_tip - window.references
    squares = (away**2).sum(axis=-1)
    total, slope = error_cost(squares, config.error_knee)
    by_after = _pulled(2.0 * slope[..., None] * away, slopes.true_tip)
    if settings.deflection_limit is not None:
        bent = np.abs(values.deflection) / settings.deflection_limit
        excess = np.maximum(bent - config.deflection_share, 0.0)
        total = total + config.deflection_weight * (excess**2).sum(axis=-1)
        weights = 2.0 * config.deflection_weight / settings.deflection_limit * excess * np.sign(values.deflection)
        by_after += _pulled(weights, slopes.deflection)
    change = window.actions.astype(np.float64) - window.earlier
    beyond = np.maximum(np.abs(window.output) - 1.0, 0.0)
    total = total + config.change_weight * (change**2).sum(axis=-1) + config.excess_weight * (beyond**2).sum(axis=-1)
    by_action = 2.0 * config.change_weight * change
    by_output = 2.0 * config.excess_weight * beyond * np.sign(window.output)
    return Costs(total, by_after, by_output, by_action, np.sqrt(squares))


def error_cost(squares: Floats, knee: float) -> tuple[Floats, Floats]:
    """Return the cost [m] of squared distances [m^2], and its derivative by them [1/m]; the knee is a distance [m].

    It is that square over twice the knee where it is small, and the distance less the knee where it is large.
    """
    root = np.sqrt(squares + knee**2)
    return squares / (root + knee), 0.5 / root


def largest_cost(settings: Settings, config: FOPGConfig) -> float:
    """Return a period's cost for an arm as far off as an episode allows; without a limit, twice its length [m]."""
    limit = settings.error_limit
    farthest = 2.0 * settings.flexible_arm.parameters.reach if limit is None else limit
    return float(error_cost(np.array(farthest**2), config.error_knee)[0])


def _pulled(weights: Floats, slopes: Floats) -> Floats:
    return np.einsum("tni,tnij->tnj", weights, slopes)
