"""Records what a function of numbers does and writes it down as straight-line code.

The physics is written once, as plain functions with loops over modes and matrices (`dynamics`, `closed_loop`).
Called with floats or numpy arrays these functions compute. Called with `Expression` objects they are recorded,
and the record is compiled: loops over modes are gone, shared subexpressions are computed once, and the compiler
can vectorise the result over the environments of a batch. No operation is reordered, so both ways round alike.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


class Trace:
    """A growing list of assignments, each `name = expression of earlier names`."""

    def __init__(self) -> None:
        """Start empty."""
        self.lines: list[str] = []
        self._names: dict[str, Expression] = {}

    def input(self, code: str) -> Expression:
        """A value that the surrounding code provides, e.g. an array element."""
        return self.assign(code)

    def assign(self, code: str) -> Expression:
        """Record one operation, or find it if it was recorded before."""
        known = self._names.get(code)
        if known is None:
            known = Expression(self, f"x{len(self.lines)}")
            self.lines.append(f"{known.name} = {code}")
            self._names[code] = known
        return known

    def inputs(self, codes: Sequence[str]) -> list[Expression]:
        """Several inputs at once."""
        return [self.input(code) for code in codes]


class Expression:
    """A number that is not known yet; arithmetic on it is recorded."""

    __slots__ = ("name", "trace")
    __array_ufunc__ = None  # numpy numbers defer to the reflected operators below

    def __init__(self, trace: Trace, name: str) -> None:
        """Made by `Trace` only."""
        self.trace = trace
        self.name = name

    def _record(self, template: str, *operands: Any) -> Expression:
        return self.trace.assign(template.format(*(_code(operand) for operand in operands)))

    def __add__(self, other: Any) -> Any:
        """Sum; adding a literal zero records nothing."""
        return self if _is(other, 0.0) else self._record("{} + {}", self, other)

    def __radd__(self, other: Any) -> Any:
        """Reflected sum."""
        return self if _is(other, 0.0) else self._record("{} + {}", other, self)

    def __sub__(self, other: Any) -> Any:
        """Difference."""
        return self if _is(other, 0.0) else self._record("{} - {}", self, other)

    def __rsub__(self, other: Any) -> Any:
        """Reflected difference."""
        return -self if _is(other, 0.0) else self._record("{} - {}", other, self)

    def __mul__(self, other: Any) -> Any:
        """Product; a literal zero or one records nothing."""
        if _is(other, 0.0) or _is(other, 1.0):
            return 0.0 if _is(other, 0.0) else self
        return self._record("{} * {}", self, other)

    def __rmul__(self, other: Any) -> Any:
        """Reflected product."""
        if _is(other, 0.0) or _is(other, 1.0):
            return 0.0 if _is(other, 0.0) else self
        return self._record("{} * {}", other, self)

    def __truediv__(self, other: Any) -> Any:
        """Quotient."""
        return self._record("{} / {}", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        """Reflected quotient."""
        return self._record("{} / {}", other, self)

    def __neg__(self) -> Any:
        """Negative."""
        return self._record("-{}", self)


def _code(operand: Any) -> str:
    return operand.name if isinstance(operand, Expression) else repr(float(operand))


def _is(operand: Any, value: float) -> bool:
    return isinstance(operand, int | float) and float(operand) == value


def floor(x: Any) -> Any:
    """Largest integer not above x, as a float."""
    return x._record("floor({})", x) if isinstance(x, Expression) else np.floor(x)


def clip(x: Any, low: Any, high: Any) -> Any:
    """x limited to [low, high]; NaN stays NaN."""
    if isinstance(x, Expression):
        return x._record("({1} if {0} < {1} else ({2} if {0} > {2} else {0}))", x, low, high)
    return np.clip(x, low, high)
