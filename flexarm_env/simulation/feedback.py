"""Many arms over many control periods, driven by linear feedback: what plans are replayed, tried and tracked with."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.codegen import cache
from flexarm_env.kernels.rk4 import FEEDBACK
from flexarm_env.simulation.held_torque import LANES, HeldTorque
from flexarm_env.simulation.open_loop import LARGEST
from flexarm_env.validation import finite_rows, finite_values, pair

Array = NDArray[np.float64]
MOST_NUMBERS = 500_000_000  # of the states of a rollout, which then take 4 GB


class Rollout(NamedTuple):
    """States and torques of arms over n control periods.

    Attributes:
        states: at the start and after each period. Shape (..., n + 1, 4 + 4 m).
        torques: held over each period, within the limits [N m]. Shape (..., n, 2).
    """

    states: Array
    torques: Array


class FeedbackTorque(HeldTorque):
    """The discrete model of an arm under linear feedback, over many control periods."""

    def rollout(
        self,
        state: ArrayLike,
        torques: ArrayLike,
        *,
        gains: ArrayLike | None = None,
        references: ArrayLike | None = None,
        torque_gains: ArrayLike | None = None,
        torque_before: ArrayLike = (0.0, 0.0),
        limits: tuple[float, float] | None = None,
        period: float = 0.01,
        step: float = 1e-3,
        payload_mass: ArrayLike | None = None,
        stiffness: ArrayLike | None = None,
        damping: ArrayLike | None = None,
    ) -> Rollout:
        """Drive one arm or many over n control periods by feed-forward torques and linear feedback.

        The torque of shoulder and elbow held over period t is

            u_t = clip(torques_t + gains_t (x_t - references_t) + torque_gains_t u_(t-1), -limits, limits).

        The leading axes of all arguments broadcast; what has none is shared by all arms and not copied. A state that
        stops being finite comes back as NaN or infinite. The result's arrays are new.

        Args:
            state: at the start. Shape (..., 4 + 4 m).
            torques: feed-forward [N m]. Shape (..., n, 2).
            gains: on the state's difference from the reference [N m/x]. Shape (..., n, 2, 4 + 4 m); None: no feedback.
            references: states x that the gains refer to, with gains only. Shape (..., n, 4 + 4 m).
            torque_gains: on the torque of the period before [1]. Shape (..., n, 2, 2); None: none.
            torque_before: torque before the first period [N m]; matters with torque gains only. Shape (..., 2).
            limits: largest torques of shoulder and elbow [N m]; None: no limit.
            period: [s]; a whole number of steps.
            step: step of the Runge-Kutta method [s].
            payload_mass: see `step`. Shape (...).
            stiffness: see `step`. Shape (...).
            damping: see `step`. Shape (...).

        Raises:
            ValueError: for bad input, a step too long, gains or references alone, or more than `MOST_NUMBERS`.
        """
        tables = self._tables(torques, gains, references, torque_gains)
        before = finite_rows("torque_before", torque_before, 2, LARGEST)
        own = {name: table.shape[: table.ndim - _AXES[name]] for name, table in tables.items()}
        quantities = payload_mass, stiffness, damping
        arms = self._arms(state, own | {"torque_before": before.shape[:-1]}, quantities)
        h, steps = self._steps(period, step, quantities)
        bound = np.array((np.inf, np.inf) if limits is None else pair("limits", limits, "N m", above=0.0))
        count, size = tables["torques"].shape[-2], arms.states.shape[1]
        if len(arms.states) * (count + 1) * size > MOST_NUMBERS:
            raise ValueError(
                f"torques: {len(arms.states)} arms over {count} periods have more than {MOST_NUMBERS} numbers of state"
            )
        states, applied = np.empty((len(arms.states), count + 1, size)), np.empty((len(arms.states), count + 1, 2))
        states[:, 0], applied[:, 0] = arms.states, np.broadcast_to(before, (*arms.leading, 2)).reshape(-1, 2)
        rows = [_shared_or_each(tables[name], own[name], arms.leading) for name in tables]
        module, arena = self._kernels(FEEDBACK, LANES)
        cache.call(module.run_feedback, arena, arms.inputs[0], *rows, bound, h, steps, states, applied)
        return Rollout(states.reshape(*arms.leading, count + 1, size), applied[:, 1:].reshape(*arms.leading, count, 2))

    def _tables(
        self,
        torques: ArrayLike,
        gains: ArrayLike | None,
        references: ArrayLike | None,
        torque_gains: ArrayLike | None,
    ) -> dict[str, Array]:
        """Check what there is for each period; what is not given has no entries."""
        size = 4 * self.parameters.modes_per_link + 4
        forward = _sequences("torques", torques, None, (2,))
        count = forward.shape[-2]
        if (gains is None) != (references is None):
            given, missing = ("references", "gains") if gains is None else ("gains", "references")
            raise ValueError(f"{missing} = None: must be given with {given}")
        tables = {"torques": forward, "gains": np.zeros((count, 0, 0)), "references": np.zeros((count, 0))}
        tables["torque_gains"] = np.zeros((count, 0, 0))
        for name, value, last in (
            ("gains", gains, (2, size)),
            ("references", references, (size,)),
            ("torque_gains", torque_gains, (2, 2)),
        ):
            if value is not None:
                tables[name] = _sequences(name, value, count, last)
        return tables


# Axes of each argument after the leading ones.
_AXES = {"torques": 2, "gains": 3, "references": 2, "torque_gains": 3}


def _sequences(name: str, value: ArrayLike, count: int | None, last: tuple[int, ...]) -> Array:
    """Check numbers of each period.

    Args:
        name: for messages.
        value: what the user gave.
        count: number of periods; None: any, but one at least.
        last: axes of one period.
    """
    array = finite_values(name, value, LARGEST)
    axes = 1 + len(last)
    wanted = ", ".join(str(n) for n in ("...", "n" if count is None else count, *last))
    shape = array.shape[-axes:]
    fits = len(shape) == axes and shape[1:] == last and (shape[0] == count if count is not None else shape[0] > 0)
    if not fits:
        raise ValueError(f"{name}: must have shape ({wanted}), got {array.shape}")
    return array


def _shared_or_each(array: Array, own: tuple[int, ...], leading: tuple[int, ...]) -> Array:
    """Return one entry for each arm, or one for all. Shape (arms or 1, ...)."""
    rest = array.shape[len(own) :]
    if all(n == 1 for n in own):
        return array.reshape(1, *rest)
    if own != leading or not array.flags.c_contiguous:
        array = np.array(np.broadcast_to(array, (*leading, *rest)), order="C")  # writable, as kernels want it
    return array.reshape(-1, *rest)
