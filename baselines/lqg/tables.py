"""A Kalman filter and a regulator along plans as tables of matrices, computed once.

The filter is `KalmanFilter` linearised along a plan. Its covariance does not depend on what is read, so that its gains
are computed beforehand (Anderson and Moore, *Optimal Filtering*, 1979, chapter 3), and what is left to do in a control
period are products of matrices, for any number of arms at once.

The motors may act late by a share of a control period, for which the torques of the period before go on.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np

from flexarm_baselines.along_plans import within_half_a_turn
from flexarm_baselines.arrays import Array, Floats, Integers, product
from flexarm_baselines.observers import KalmanFilter, Transition
from flexarm_baselines.optimal import LinearQuadratic, Plan

Place = tuple[Array, Array]  # plans and control periods of n arms. Shape (n,) each


def joined(tables: Sequence[Any], dtype: Any = np.float32) -> Any:
    """Concatenate the tables of several sets of plans, by default in single precision, which halves the memory."""
    kind, names = type(tables[0]), [one.name for one in fields(tables[0]) if one.name != "rows"]
    parts = {name: np.concatenate([getattr(one, name) for one in tables]).astype(dtype) for name in names}
    return kind(**parts, **({"rows": tables[0].rows} if hasattr(tables[0], "rows") else {}))


def read_only(tables: Any) -> Any:
    """Make the arrays of tables read-only, since others have the same ones."""
    for one in fields(tables):
        getattr(tables, one.name).flags.writeable = False
    return tables


@dataclass(frozen=True)
class FilterTables:
    """A Kalman filter along l plans of N control periods; z is the mean of its `Estimate`, with d numbers.

    The first k of these are state and quantities. What a control period moves are the s numbers of the state, and
    the tip's newest point.

    Attributes:
        nominal: z along the plan. Shape (l, N + 1, d).
        matrix: derivatives of what is moved by the first k. Shape (l, N, s + 2, k).
        by_torque: its derivatives by torques that act for the whole period. Shape (l, N, s + 2, 2).
        by_half: its derivatives by torques that act for the second half. Shape (l, N, s + 2, 2).
        torque: the plan's [N m]. Shape (l, N, 2).
        after: what is moved, at the end of a period that the filter's model begins on the plan; on the plan again if it
            is made for that model. Shape (l, N, s + 2).
        gain: on the residuals of r readings. Shape (l, N, d, r).
        information: inverse of the covariance of the residuals. Shape (l, N, r, r).
        rows: place in z of each reading. Shape (r,).
    """

    nominal: Floats
    matrix: Floats
    by_torque: Floats
    by_half: Floats
    torque: Floats
    after: Floats
    gain: Floats
    information: Floats
    rows: Integers

    @classmethod
    def along(cls, kalman: KalmanFilter, plans: Sequence[Plan], gauges: bool = False, **values: Any) -> Self:
        """Linearise the filter along plans, and compute its gains.

        Args:
            kalman: the filter.
            plans: as long as each other.
            gauges: whether there are strain gauges.
            **values: quantities that are not the filter's own, see `KalmanFilter.linearise`.
        """
        count, periods = len(plans), len(plans[0].torques)
        states = np.stack([plan.states for plan in plans])
        torques = np.stack([plan.torques for plan in plans])
        size = states.shape[2]
        flat = states[:, :-1].reshape(-1, size), torques.reshape(-1, 2)
        now = _carrying(kalman, plans, values)
        along = Transition(*(part.reshape(count, periods, *part.shape[1:]) for part in kalman.linearise(*flat, **now)))
        if "payload_mass" in kalman.quantities:
            column = size + kalman.quantities.index("payload_mass")
            others = np.arange(kalman.size) != column
            along.matrix[..., others, column] *= np.stack([plan.own_payload for plan in plans])[..., None]
        start = kalman.start(states[:, 0], **values)
        rows, _ = kalman.sensors(gauges)
        there = np.ones((count, len(rows)), dtype=bool)
        nominal = np.empty((count, periods + 1, kalman.size))
        gain = np.empty((count, periods, kalman.size, len(rows)))
        information = np.empty((count, periods, len(rows), len(rows)))
        nominal[:, 0], covariance = start.mean, start.covariance
        for k in range(periods):
            gain[:, k], covariance, expected = kalman.gain(covariance, there)
            information[:, k] = np.linalg.inv(expected)
            transition = Transition(*(part[:, k] for part in along))
            covariance = kalman.spread(covariance, transition)
            nominal[:, k + 1] = kalman.moved(nominal[:, k], transition)
            nominal[:, k + 1, :size] = states[:, k + 1]
        known = size + len(kalman.quantities)
        moved = [*range(size), known, known + 1]
        return cls(
            nominal,
            along.matrix[..., moved, :known],
            along.by_torque[..., moved, :],
            _by_half(kalman, along, flat, moved, now),
            torques,
            np.concatenate([along.state, along.seen], axis=-1),
            gain,
            information,
            np.array(rows),
        )

    def residual(self, estimate: Floats, readings: Floats) -> Floats:
        """Return readings less what z says that they are, 0 where a reading is missing (NaN). Shape (n, r)."""
        return np.nan_to_num(within_half_a_turn(readings - estimate[:, self.rows]))

    def predict(self, at: Place, estimate: Floats, before: Floats, torque: Floats, late: Floats) -> Floats:
        """Return z a control period later. Shape (n, d).

        Args:
            at: plans and periods.
            estimate: z. Shape (n, d).
            before: torque of the period before [N m]. Shape (n, 2).
            torque: that follows it [N m]. Shape (n, 2).
            late: share of the period after which it does. Shape (n, 1).
        """
        known = self.matrix.shape[-1]
        moved = self.after[at] + product(self.matrix[at], (estimate - self.nominal[at])[:, :known])
        moved += product(self.by_torque[at], before - self.torque[at])
        linear, square = self._by_change(at, torque - before)
        return self._next(estimate, moved + (1.0 - late) * (linear + (1.0 - late) * square))

    def by_lateness(self, at: Place, slope: Floats, before: Floats, torque: Floats, late: Floats) -> Floats:
        """Return the derivative of `predict` by the share after which torques act in all periods so far. Shape (n, d).

        Args:
            at: see `predict`.
            slope: that of z. Shape (n, d).
            before: see `predict`.
            torque: see `predict`.
            late: see `predict`.
        """
        linear, square = self._by_change(at, torque - before)
        moved = product(self.matrix[at], slope[:, : self.matrix.shape[-1]])
        return self._next(slope, moved - linear - 2.0 * (1.0 - late) * square)

    def _by_change(self, at: Place, change: Floats) -> tuple[Floats, Floats]:
        """Return the effect of a change of the torques, linear and square in the share of the period in which it acts.

        Their sum is exact for none, half and all of the period.
        """
        whole, half = product(self.by_torque[at], change), product(self.by_half[at], change)
        return 4.0 * half - whole, 2.0 * whole - 4.0 * half

    def _next(self, estimate: Floats, moved: Floats) -> Floats:
        """Put z together: what has moved, quantities, the tip's newest point, and those before it."""
        known, size = self.matrix.shape[-1], moved.shape[1] - 2
        parts = moved[:, :size], estimate[:, size:known], moved[:, size:], estimate[:, known:-2]
        return np.concatenate(parts, axis=1)


def _carrying(kalman: KalmanFilter, plans: Sequence[Plan], values: dict[str, Any]) -> dict[str, Any]:
    """Return the quantities of all periods of all plans, one after the other, where their payload changes."""
    if all(plan.payloads is None for plan in plans):
        return values
    each = [plan.carrying(values, kalman.arm)["payload_mass"] for plan in plans]
    masses = np.concatenate([np.broadcast_to(x, len(plan.torques)) for x, plan in zip(each, plans, strict=True)])
    return values | {"payload_mass": masses}


def _by_half(
    kalman: KalmanFilter, along: Transition, flat: tuple[Floats, Floats], moved: list[int], values: dict[str, Any]
) -> Floats:
    """Return derivatives by torques that act for the second half of each period; see `FilterTables`."""
    half = 0.5 * kalman.period
    arm = {name: value for name, value in values.items() if name != "delay"}
    middle = kalman.arm.step(*flat, half, **arm)
    found = 0.5 * along.by_torque[..., moved, :]  # the tip's point within the period: on average
    own = kalman.arm.step_jacobians(middle, flat[1], half, **arm).by_torque
    found[..., : len(moved) - 2, :] = own.reshape(*found.shape[:2], *own.shape[1:])
    return found


@dataclass(frozen=True)
class RegulatorTables:
    """A regulator along l plans of N control periods.

    Attributes:
        torque: the plan's, or 0 without feed-forward; the last is there twice [N m]. Shape (l, N + 1, 2).
        gain: on deviations of state, of quantities and of the torques of the period before, and on the integral of
            the tip's deviation, if there is one [N m/x]. Shape (l, N, 2, ...).
    """

    torque: Floats
    gain: Floats

    @classmethod
    def along(
        cls,
        plans: Sequence[Plan],
        problems: Sequence[LinearQuadratic],
        late: float = 0.0,
        integral: float | None = None,
        feed_forward: bool = True,
    ) -> Self:
        """Compute the gains, those of `PlanRegulator` where nothing but the state counts.

        Args:
            plans: as long as each other.
            problems: deviations from each of them.
            late: share of a period after which torques act.
            integral: integral of the tip's deviation that weighs as much as the deviations of the weights do [m s];
                None: no integral action.
            feed_forward: whether the plans' torques act.
        """
        problems = [problem.with_actuation_delay(late) for problem in problems]
        if integral is not None:
            problems = [problem.with_integral(integral) for problem in problems]
        torques = np.stack([np.concatenate([plan.torques, plan.torques[-1:]]) for plan in plans])
        return cls(torques * float(feed_forward), np.stack([problem.gains() for problem in problems]))

    def torques(self, at: Place, deviation: Floats, before: Floats, late: Floats, integral: Floats) -> Floats:
        """Return the torques without their limits [N m]. Shape (n, 2).

        Args:
            at: plans and periods.
            deviation: of state and quantities from the plan's. Shape (n, ...).
            before: torque of the period before [N m]. Shape (n, 2).
            late: share of the period after which torques act. Shape (n, 1).
            integral: of the tip's deviation [m s]. Shape (n, 2), or (n, 0) if it does not count.
        """
        plan, period = at
        earlier = np.where((period > 0)[:, None], self._ahead((plan, np.maximum(period - 1, 0)), late), 0.0)
        counts = np.concatenate([deviation, before - earlier, integral], axis=1)
        return self._ahead(at, late) + product(self.gain[at], counts)

    def _ahead(self, at: Place, late: Floats) -> Floats:
        """Return the plan's torques of a little later, so that they act in time. Shape (n, 2)."""
        plan, period = at
        return (1.0 - late) * self.torque[at] + late * self.torque[plan, period + 1]
