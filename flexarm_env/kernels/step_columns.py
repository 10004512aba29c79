"""Recorded kernels of the columns of Jacobians over a control period.

`step_jacobians` says what columns and slopes are. A column is of positions and rates at a period's ends, of positions
and momenta in between.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any

from flexarm_env.codegen.arrays import LaneRows
from flexarm_env.kernels.layout import slope_sizes
from flexarm_env.kernels.recorder import Recorder, recorded_by
from flexarm_env.kernels.tableau import RK4_NODES, RK4_WEIGHTS
from flexarm_env.kernels.variants import Variant
from flexarm_env.physics import linear_algebra
from flexarm_env.physics.linear_algebra import plus_scaled


class ColumnRecorder(Recorder):
    """Records what happens to one column."""

    def __init__(self, variant: Variant, with_input: bool) -> None:
        """Begin; `with_input`: the column is of an input that acts all the time."""
        super().__init__(variant, inlining=True)
        self.with_input = with_input
        self.slope_sizes = slope_sizes(variant.modes)
        column = self.rows_of("column", 2 * variant.size)
        self.y, self.other = column[: variant.size], column[variant.size :]

    def slopes(self, name: str, stage: int) -> list[Any]:
        """Read a part of a stage's slopes."""
        names = list(self.slope_sizes)
        first = stage * sum(self.slope_sizes.values()) + sum(self.slope_sizes[n] for n in names[: names.index(name)])
        return self.rows_of("slopes", self.slope_sizes[name], first)

    def acting(self, stage: int) -> list[Any]:
        """Read the derivatives of the momenta and of the force at a stage by the column's own input; none: zeros."""
        if not self.with_input:
            return [0.0] * (2 * self.variant.size)
        return self.rows_of("input", 2 * self.variant.size, stage * sum(self.slope_sizes.values()))

    def times(self, slopes: Sequence[Any], change: Sequence[Any], start: Sequence[Any]) -> list[Any]:
        """Add to `start` the products of slopes, one row for each change, with the changes."""
        size, total = self.variant.size, list(start)
        for n, x in enumerate(change):
            total = plus_scaled(total, x, slopes[n * size : n * size + size])
        return total

    def turned(self, y: Sequence[Any]) -> list[Any]:
        """Return the changes of the positions that slopes are by: those of a2 - a1, q1 and q2."""
        m = self.variant.modes
        return [*y[1 : m + 1], y[m + 1] - y[0], *y[m + 2 :]]

    def momentum_change(self, stage: int, y: Sequence[Any]) -> list[Any]:
        """Return d(M v) at constant v."""
        return self.times(self.slopes("momentum_by_y", stage), self.turned(y), self.acting(stage)[: self.variant.size])

    def rates(self, stage: int, y: Sequence[Any], p: Sequence[Any]) -> list[Any]:
        """Return dv."""
        off = [a - b for a, b in zip(p, self.momentum_change(stage, y), strict=True)]
        return linear_algebra.symmetric_times(self.slopes("inverse", stage), off)

    def forces(self, stage: int, y: Sequence[Any], v: Sequence[Any]) -> list[Any]:
        """Return d(p')."""
        force = self.times(self.slopes("force_by_y", stage), self.turned(y), self.acting(stage)[self.variant.size :])
        return self.times(self.slopes("force_by_v", stage), v, force)


_column = partial(ColumnRecorder, with_input=False)
_input_column = partial(ColumnRecorder, with_input=True)


def carry(r: ColumnRecorder, h: Any) -> None:
    """Apply the classical Runge-Kutta method to the linear system of a column, of positions and momenta."""
    start = [*r.y, *r.other]
    stage, total = start, [0.0] * len(start)
    for number, (next_node, weight) in enumerate(zip((*RK4_NODES[1:], 0.0), RK4_WEIGHTS, strict=True)):
        y, p = stage[: r.variant.size], stage[r.variant.size :]
        v = r.rates(number, y, p)
        slope = [*v, *r.forces(number, y, v)]
        total = plus_scaled(total, weight, slope)
        stage = plus_scaled(start, h * next_node, slope)
    r.store("column", plus_scaled(start, h / 6.0, total))


@recorded_by(_column)
def column_kernel(r: ColumnRecorder, column: LaneRows, slopes: LaneRows, h: float) -> None:
    """Carry one column of every lane over a step.

    Args:
        r: records it.
        column: of positions and momenta, before and after. Shape (2 * size, lanes).
        slopes: those of all stages, one after the other (`layout.slope_sizes`). Shape (stages * slope_rows, lanes).
        h: step [s].
    """
    carry(r, h)


@recorded_by(_input_column)
def input_column_kernel(r: ColumnRecorder, column: LaneRows, slopes: LaneRows, input: LaneRows, h: float) -> None:
    """Carry one column of every lane over a step, of an input that acts all the time.

    Args:
        r: records it.
        column: see `column_kernel`.
        slopes: see `column_kernel`.
        input: `slopes` from the first of this input on.
        h: step [s].
    """
    carry(r, h)


@recorded_by(_column)
def begin_column_kernel(r: ColumnRecorder, column: LaneRows, slopes: LaneRows) -> None:
    """Turn a column of positions and rates into one of positions and momenta; see `column_kernel`."""
    bent = linear_algebra.symmetric_times(r.slopes("mass", 0), r.other)
    p = [a + b for a, b in zip(bent, r.momentum_change(0, r.y), strict=True)]
    r.store("column", p, r.variant.size)


@recorded_by(_column)
def end_column_kernel(r: ColumnRecorder, column: LaneRows, slopes: LaneRows) -> None:
    """Turn a column of positions and momenta into one of positions and rates; see `column_kernel`."""
    r.store("column", r.rates(0, r.y, r.other), r.variant.size)


@recorded_by(_input_column)
def input_end_column_kernel(r: ColumnRecorder, column: LaneRows, slopes: LaneRows, input: LaneRows) -> None:
    """`end_column_kernel` of an input that acts all the time; see `input_column_kernel`."""
    r.store("column", r.rates(0, r.y, r.other), r.variant.size)
