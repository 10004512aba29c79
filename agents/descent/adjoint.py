"""Derivatives of a window's costs by the network's outputs: the chain rule, from its last period to its first.

An action changes the later states, their immediate and late readings, the later actions of the network, and the past
actions in the observations. Derivatives by the state go back through a period by the compiled adjoints of the arm
(`FlexibleArm.step_gradients`), in parts that end where the sensor reads within the period.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from flexarm_agents.descent.observations import Instant, Observations, Seen, instants
from flexarm_agents.descent.window import Costs, Window, usable

Floats = NDArray[np.float64]
MOST = 1e9  # [m]; a larger derivative by an output is that of an arm that flies apart


def seen_in(window: Window, actions: int) -> Seen:
    """Return the inputs from which the observations at a window's instants were made.

    Actions before the window, or before the episode, are 0; at the first instant the earlier reading is the present
    one. Nothing in the window can change either.
    """
    earlier = np.concatenate([window.readings[:1], window.readings[:-1]])
    past = np.zeros((*window.ages.shape, actions, 2))
    for back in range(min(actions, len(window.actions))):
        known = window.ages[back + 1 :] > back
        past[back + 1 :, :, back] = np.where(known[..., None], window.actions[: len(known)], 0.0)
    return Seen(window.states, window.readings, earlier, past)


class Adjoint:
    """Derivatives of a window's costs, accumulated from its end to its beginning.

    Attributes:
        by_state: by the state at each instant, accumulated so far. Shape (T + 1, n, 4 + 4 m).
        by_action: by the action of each period, apart from its effect on the arm. Shape (T, n, 2).
        left_out: arms whose derivatives are not finite, or too large; theirs are set to 0. Shape (n,).
    """

    def __init__(self, observations: Observations, window: Window) -> None:
        settings = observations.settings
        self._window, self._model, self._arm = window, observations, settings.flexible_arm
        self._step = settings.control_period / settings.substeps
        self._substeps, self._instants = settings.substeps, instants(settings)
        self._torques = window.actions * np.array(settings.motor_limit)
        seen = seen_in(window, settings.last_actions)
        self._slopes = observations.slopes(seen, observations.task(window.observations, seen))
        stops = sorted({one.substeps for one in self._instants} | {0}, reverse=True)
        self._stops = {stop: self._states_at(stop) for stop in stops}
        position = settings.sensor_position
        self._reads = {
            stop: self._arm.output_jacobians(states, position)[1].sensed for stop, states in self._stops.items()
        }
        self._within: dict[tuple[int, int], Floats] = {}  # by states within a period: of the period and the stop
        self.by_state, self.by_action = np.zeros_like(window.states), np.zeros(window.actions.shape)
        self.left_out = np.zeros(window.actions.shape[1], dtype=bool)

    def observe(self, t: int, weights: Floats) -> None:
        """Add the derivatives through an observation.

        Args:
            t: instant; the derivatives by states and actions before it are not complete yet.
            weights: derivatives by the numbers of the observation; those of an episode's first one do not count, since
                no action changes it. Shape (n, k).
        """
        age = self._window.ages[t]
        given = weights * (age > 0)[:, None]
        by_point = np.matmul(given[:, None], self._slopes[t])[:, 0]
        self.by_state[t] += given @ self._model.by_state
        self.by_state[t][:, self._model.encoders] += by_point[:, :4]
        for periods, by_reading in enumerate((by_point[:, 4:6], by_point[:, 6:])):
            for one in self._instants:
                self._read(t, periods + one.periods, one, by_reading)
        by_past = given @ self._model.by_actions
        for back in range(min(by_past.shape[1] // 2, t)):
            known = (age > back)[:, None]
            self.by_action[t - 1 - back] += np.where(known, by_past[:, 2 * back : 2 * back + 2], 0.0)

    def back_through(self, t: int, by_after: Floats) -> Floats:
        """Go back through a period, and return the derivatives by its action.

        Args:
            t: the period; all later observations have been added.
            by_after: derivatives of its own cost by the state after it. Shape (n, 4 + 4 m).
        """
        weights = by_after + np.where(self._window.ended[t][:, None], 0.0, self.by_state[t + 1])
        by_torque, end = np.zeros((len(weights), 2)), self._substeps
        for stop, states in self._stops.items():
            self.left_out |= ~np.isfinite(weights).all(axis=1)
            weights, span = np.where(self.left_out[:, None], 0.0, weights), (end - stop) * self._step
            found = self._arm.step_gradients(states[t], self._torques[t], weights, span, step=self._step)
            weights, by_torque, end = found.by_state, by_torque + found.by_torque, stop
            if (t, stop) in self._within:
                weights = weights + self._within.pop((t, stop))
        self.by_state[t] += weights
        return self.by_action[t] + by_torque * np.array(self._model.settings.motor_limit)

    def _read(self, t: int, periods: int, one: Instant, weights: Floats) -> None:
        """Add the derivatives through a reading that was taken so many periods before instant t."""
        if t < periods:
            return
        known = (self._window.ages[t] >= periods)[:, None]
        both = np.concatenate([one.position * weights, one.rate * weights], axis=1) * known
        by_state = np.matmul(both[:, None], self._reads[one.substeps][t - periods])[:, 0]
        if one.substeps == 0:
            self.by_state[t - periods] += by_state
        else:
            place = t - periods, one.substeps
            self._within[place] = self._within.get(place, 0.0) + by_state

    def _states_at(self, stop: int) -> Floats:
        """Return the states so many integration steps after the beginning of each period, or at each instant."""
        if stop == 0:
            return self._window.states
        states = self._window.states[:-1]
        return usable(self._arm.step(states, self._torques, stop * self._step, step=self._step), states)


def output_gradients(
    observations: Observations, window: Window, costs: Costs, network: Floats, at_end: Floats, discounts: Floats
) -> Floats:
    """Differentiate the discounted costs of a window, and what comes after it, by the network's outputs.

    Args:
        observations: of the batch.
        window: the window.
        costs: of its periods.
        network: derivatives of the outputs by the first numbers of the observation. Shape (T, n, 2, numbers).
        at_end: derivatives of what comes after by the last instant's observation; where an episode ended with the
            window, it is 0. Shape (n, k).
        discounts: of each period's costs. Shape (T, n).

    Returns:
        The derivatives, the effect on later outputs included; 0 for arms whose derivatives are larger than
        `MOST`. Shape (T, n, 2).
    """
    adjoint, size = Adjoint(observations, window), network.shape[-1]
    found, weights = np.zeros(window.output.shape), discounts[..., None]
    adjoint.observe(len(found), at_end)
    for t in range(len(found) - 1, -1, -1):
        by_action = adjoint.back_through(t, weights[t] * costs.by_after[t]) + weights[t] * costs.by_action[t]
        free = np.abs(window.output[t]) < 1.0
        found[t] = np.where(free, by_action, 0.0) + weights[t] * costs.by_output[t]
        if t > 0:
            going_on = (window.ages[t] > 0)[:, None]
            adjoint.by_action[t - 1] -= np.where(going_on, weights[t] * costs.by_action[t], 0.0)
            by_observation = np.zeros(at_end.shape)
            by_observation[:, :size] = np.matmul(found[t][:, None], network[t])[:, 0]
            adjoint.observe(t, by_observation)
    adjoint.left_out |= ~(np.abs(found) <= MOST).all(axis=(0, 2))
    found[:, adjoint.left_out] = 0.0
    return found
