"""Many arms over control periods, driven by held torques or linear feedback: plans are replayed and tried with it.

The classical Runge-Kutta method of fourth order.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flexarm_env.codegen import cache
from flexarm_env.kernels.rk4 import FEEDBACK
from flexarm_env.simulation.held_torque import Arms, HeldTorque, rows_of
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
    """The discrete model of an arm over control periods, with held torques or under linear feedback."""

    def step(
        self,
        state: ArrayLike,
        torque: ArrayLike,
        period: float = 0.01,
        *,
        step: float = 1e-3,
        payload_mass: ArrayLike | None = None,
        stiffness: ArrayLike | None = None,
        damping: ArrayLike | None = None,
    ) -> Array:
        """Compute the state a control period later, of one arm or of many at once.

        Leading axes of all arguments broadcast. A state that stops being finite comes back as NaN or infinite.

        Args:
            state: Shape (..., 4 + 4 m).
            torque: held over the period, of shoulder and elbow [N m]. Shape (..., 2).
            period: [s]; a whole number of steps.
            step: step of the Runge-Kutta method [s].
            payload_mass: [kg], 0 to 1000; None: the arm's own. Shape (...).
            stiffness: factor on the stiffness of both links, 0.001 to 1000; None: 1. Shape (...).
            damping: damping ratio (`physics.damping`) at that stiffness, 0 to 1; None: the arm's own. Shape (...).

        Returns:
            States, new. Shape (..., 4 + 4 m).

        Raises:
            ValueError: for bad input; a step too long is refused with the longest that is allowed.
        """
        given = payload_mass, stiffness, damping
        arms, torques = self._driven(state, torque, given)
        h, steps = self._steps(period, step, given)
        states, _ = self._run(arms, torques[:, None], h, steps)
        return arms.shaped(states[:, 1])

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
        bound = (np.inf, np.inf) if limits is None else pair("limits", limits, "N m", above=0.0)
        count, size = tables["torques"].shape[-2], arms.states.shape[1]
        if len(arms.states) * (count + 1) * size > MOST_NUMBERS:
            raise ValueError(
                f"torques: {len(arms.states)} arms over {count} periods have more than {MOST_NUMBERS} numbers of state"
            )
        forward, *feedback = (_shared_or_each(tables[name], own[name], arms.leading) for name in tables)
        first = np.broadcast_to(before, (*arms.leading, 2)).reshape(-1, 2)
        return Rollout(*map(arms.shaped, self._run(arms, forward, h, steps, feedback, first, bound)))

    def _run(
        self,
        arms: Arms,
        torques: Array,
        h: float,
        steps: int,
        feedback: Sequence[Array] = (),
        before: float | Array = 0.0,
        limits: tuple[float, float] = (np.inf, np.inf),
    ) -> tuple[Array, Array]:
        """Drive arms over n periods; return states and torques. Shapes (arms, n + 1, 4 + 4 m) and (arms, n, 2).

        Args:
            arms: at the start.
            torques: feed-forward [N m]. Shape (arms or 1, n, 2).
            h: step [s].
            steps: in each period.
            feedback: gains, references and torque gains (`rk4.run_feedback`); none: torques are held as they are.
            before: torque before the first period [N m]. Shape (arms, 2).
            limits: largest torques [N m].
        """
        (count, size), periods = arms.states.shape, torques.shape[1]
        states, applied = np.empty((count, periods + 1, size)), np.empty((count, periods + 1, 2))
        states[:, 0], applied[:, 0] = arms.states, before
        tables = feedback or (table[None] for table in _no_feedback(periods).values())
        module, arena = self._kernels(FEEDBACK, arms.lanes)
        known = arena, arms.inputs[0], torques, *tables, np.array(limits)
        cache.call(module.run_feedback, *known, h, steps, states, applied)
        return states, applied[:, 1:]

    def _run_held(self, start: Array, held: Array, step: float, substeps: int) -> tuple[Array, Array]:
        """Hold each torque over one step; results as of `OpenLoop.run`."""
        arms = Arms((1,), start[None], self._own)
        states = self._run(arms, np.array(held)[None], step / substeps, substeps)[0][0]
        finite = np.isfinite(states).all(axis=1)
        states = states if finite.all() else states[: finite.argmin()]
        return states, np.concatenate([held, held[-1:]])[: len(states)]

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
        tables = {"torques": forward, **_no_feedback(count)}
        for name, value, last in (
            ("gains", gains, (2, size)),
            ("references", references, (size,)),
            ("torque_gains", torque_gains, (2, 2)),
        ):
            if value is not None:
                tables[name] = _sequences(name, value, count, last)
        return tables


def step_each(arms: Sequence[FeedbackTorque], state: Array, torque: Array, period: float, step: float) -> Array:
    """Return `FeedbackTorque.step` of arms that differ in numbers alone. Shape (arms, n, 4 + 4 m).

    Args:
        arms: of one number of modes, kinematics and velocity forces; only the first one's longest step is checked.
        state: of all of them. Shape (n, 4 + 4 m).
        torque: on all of them. Shape (n, 2).
        period: see `FeedbackTorque.step`.
        step: see there.
    """
    if len(kinds := {(len(one._own[0][0]), one.parameters.velocity_forces, one.constants.dry) for one in arms}) != 1:
        raise ValueError(f"arms of {len(kinds)} kinds; shapes, kinematics and forces must be the same")
    h, steps = arms[0]._steps(period, step, (None, None, None))
    leading = len(arms), len(state)
    known = np.repeat(np.concatenate([one._own[0] for one in arms]), len(state), axis=0)
    each = Arms(leading, rows_of(state, leading), (known, known[:, :0]))
    return each.shaped(arms[0]._run(each, rows_of(torque, leading)[:, None], h, steps)[0][:, 1])


# Axes of each argument after the leading ones.
_AXES = {"torques": 2, "gains": 3, "references": 2, "torque_gains": 3}


@lru_cache(maxsize=8)
def _no_feedback(count: int) -> dict[str, Array]:
    """Return the tables of so many periods without feedback, which have no entries."""
    return {name: np.zeros((count, *(0,) * (_AXES[name] - 1))) for name in ("gains", "references", "torque_gains")}


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
