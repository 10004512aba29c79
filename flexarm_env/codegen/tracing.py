"""Records what a function of numbers does, as straight-line code.

The physics is written once, as plain functions with loops over modes and matrices (`dynamics`, `jacobian_transpose`).
Called with floats or numpy arrays these functions compute. Called with `Expression` objects they are recorded,
and the record is compiled: loops over modes are gone, shared subexpressions are computed once, and the compiler
can vectorise the result over the environments of a batch. No operation is reordered, but a product that one sum alone
uses is fused with it: rounded once, in one instruction, wherever the code runs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial, wraps
from inspect import unwrap
from typing import Any, NamedTuple

import numpy as np

from flexarm_env.codegen import scalars

Formula = Callable[..., Any]
# Sums and differences, which operand may be a product, and what they are with it: a * b + c, c - a * b, a * b - c.
_FUSED = (
    ("add", 1, "multiply_add"),
    ("add", 0, "multiply_add"),
    ("subtract", 1, "multiply_subtract_from"),
    ("subtract", 0, "multiply_subtract"),
)


class Operation(NamedTuple):
    """One operation of a record.

    Attributes:
        name: "row" or "number" of an input, "call" of a function, "result" of a call, else that of the arithmetic.
        operands: indices of earlier operations; a literal is a text.
        what: of an input its argument, and the row, or the places of an element; of a call the function; of a result
            its place.
    """

    name: str
    operands: tuple[int | str, ...] = ()
    what: tuple[Any, ...] = ()


class Recording(NamedTuple):
    """A record that is complete: a kernel, or a function that kernels call.

    Attributes:
        parameters: names of the arguments.
        operations: in their order.
        results: operation, or literal, of each number that is returned or stored.
        places: array and row where a kernel stores each result; none of a function.
        functions: recordings that its calls name.
    """

    parameters: tuple[str, ...]
    operations: list[Operation]
    results: list[int | str]
    places: list[tuple[str, int]]
    functions: dict[str, Recording] = {}  # noqa: RUF012


class Trace:
    """A growing list of operations, each on inputs, literals and earlier operations."""

    def __init__(self, inlining: bool = False) -> None:
        """Start empty; `inlining`: formulas that are recorded once elsewhere (`recorded_once`) become part of it."""
        self.inlining = inlining
        self._operations: list[Operation] = []
        self._known: dict[Operation, Expression] = {}

    def number(self, argument: str, *places: int) -> Expression:
        """Record the reading of an argument, or of an element of one."""
        return self._add(Operation("number", (), (argument, *places)))

    def row(self, array: str, row: int) -> Expression:
        """Record the reading of a lane's number in a row of an array."""
        return self._add(Operation("row", (), (array, row)))

    def assign(self, name: str, *operands: Any) -> Expression:
        """Record arithmetic."""
        return self._add(Operation(name, tuple(map(_code, operands))))

    def call(self, function: str, arguments: Sequence[Any], count: int) -> list[Expression]:
        """Record a call of a function that returns `count` numbers."""
        called = self._add(Operation("call", tuple(map(_code, arguments)), (function,)))
        return [self._add(Operation("result", (called.index,), (n,))) for n in range(count)]

    def _add(self, operation: Operation) -> Expression:
        """Record an operation, or find it if it was recorded before."""
        known = self._known.get(operation)
        if known is None:
            known = self._known[operation] = Expression(self, len(self._operations))
            self._operations.append(operation)
        return known

    def reads(self, argument: str) -> bool:
        """Return whether the record reads an argument, or an element of it."""
        return any(operation.what[:1] == (argument,) for operation in self._operations if not operation.operands)

    def recording(
        self,
        parameters: Sequence[str],
        results: Sequence[Any],
        places: Sequence[tuple[str, int]] = (),
        fusing: bool = True,
    ) -> Recording:
        """Complete the record (see `Recording`), without what no result needs; `fusing`: merge sums with products."""
        codes = [_code(result) for result in results]
        operations = self._fused(codes) if fusing else self._operations
        uses = _uses(operations, codes)
        numbers = {old: new for new, old in enumerate(sorted(uses))}

        def renumbered(codes: Sequence[int | str]) -> list[int | str]:
            return [numbers[code] if isinstance(code, int) else code for code in codes]

        needed = [operations[old]._replace(operands=tuple(renumbered(operations[old].operands))) for old in numbers]
        return Recording(tuple(parameters), needed, renumbered(codes), list(places))

    def _fused(self, results: Sequence[int | str]) -> list[Operation]:
        """Merge each sum with a product that nothing else uses; arguments of calls are rounded by themselves."""
        uses = _uses(self._operations, results)
        kept = {code for one in self._operations if one.name == "call" for code in one.operands} | set(results)
        products = {
            index: operation.operands
            for index, operation in enumerate(self._operations)
            if operation.name == "multiply" and uses.get(index) == 1 and index not in kept
        }
        fused = []
        for operation in self._operations:
            for name, place, merged in _FUSED:
                if operation.name == name and operation.operands[place] in products:
                    product = products[operation.operands[place]]  # type: ignore[index]
                    operation = Operation(merged, (*product, operation.operands[1 - place]))
                    break
            fused.append(operation)
        return fused


def _uses(operations: Sequence[Operation], results: Sequence[int | str]) -> dict[int, int]:
    """Return how often each needed operation is used; the results count once more."""
    uses = Counter(code for code in results if isinstance(code, int))
    for index in reversed(range(len(operations))):
        if index in uses:
            uses.update(code for code in operations[index].operands if isinstance(code, int))
    return uses


class Symbol(ABC):
    """A number of another kind than floats and arrays; the functions of this module dispatch to its `apply`.

    Attributes:
        rank: among the arguments of a call, a symbol of the highest rank is dispatched to.
    """

    __slots__ = ()
    __array_ufunc__ = None  # numpy numbers defer to the reflected operators
    rank = 0

    @abstractmethod
    def apply(self, function: Formula, arguments: Sequence[Any]) -> Any:
        """Apply a function of this module, or one recorded once, to arguments of which this symbol is one."""


class Expression(Symbol):
    """A number that is not known yet; arithmetic on it is recorded, unless a literal 0 or 1 spares it."""

    __slots__ = ("index", "trace")

    def __init__(self, trace: Trace, index: int) -> None:
        """Made by `Trace` only."""
        self.trace = trace
        self.index = index

    def _record(self, name: str, *operands: Any) -> Any:
        """Record the operation; return NotImplemented if an operand has a higher rank."""
        if any(isinstance(operand, Symbol) and operand.rank > self.rank for operand in operands):
            return NotImplemented
        return self.trace.assign(name, *operands)

    def apply(self, function: Formula, arguments: Sequence[Any]) -> Any:
        """Record a primitive, or a call."""
        primitive = _PRIMITIVES.get(function)
        if primitive is not None:
            return self._record(primitive, *arguments)
        name, count = _CALLED[function]
        if self.trace.inlining and name == recorded_name(function):
            return unwrap(function)(*arguments)
        results = self.trace.call(name, arguments, count)
        return tuple(results) if count > 1 else results[0]

    def __add__(self, other: Any) -> Any:
        return self if is_literal(other, 0.0) else self._record("add", self, other)

    def __radd__(self, other: Any) -> Any:
        return self if is_literal(other, 0.0) else self._record("add", other, self)

    def __sub__(self, other: Any) -> Any:
        return self if is_literal(other, 0.0) else self._record("subtract", self, other)

    def __rsub__(self, other: Any) -> Any:
        return -self if is_literal(other, 0.0) else self._record("subtract", other, self)

    def __mul__(self, other: Any) -> Any:
        if is_literal(other, 0.0) or is_literal(other, 1.0):
            return 0.0 if is_literal(other, 0.0) else self
        return self._record("multiply", self, other)

    def __rmul__(self, other: Any) -> Any:
        if is_literal(other, 0.0) or is_literal(other, 1.0):
            return 0.0 if is_literal(other, 0.0) else self
        return self._record("multiply", other, self)

    def __truediv__(self, other: Any) -> Any:
        return self._record("divide", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        return self._record("divide", other, self)

    def __neg__(self) -> Any:
        return self._record("negate", self)


_PRIMITIVES: dict[Formula, str] = {}  # names of their operations
_NUMBERS = frozenset({float, np.float64})
_CALLED: dict[Formula, tuple[str, int]] = {}  # their names in kernels, and how many results they have


def recorded_once(count: int) -> Callable[[Formula], Formula]:
    """Decorate a formula with several results, `count`, that a module's kernels share: a record calls it.

    Compiling takes longer the more there is to read; a sine has fifty operations, and a step of the arm eight sines.
    """
    return lambda formula: _called(recorded_name(formula), count)(formula)


def _called(name: str, count: int, of_numbers: Formula | None = None) -> Callable[[Formula], Formula]:
    """Decorate a function of numbers and arrays that a record calls by a name; `of_numbers`: see `_asking`."""

    def decorated(formula: Formula) -> Formula:
        function = _asking(formula, of_numbers or formula)
        _CALLED[function] = name, count
        return function

    return decorated


def recorded_name(formula: Formula) -> str:
    """Return what a shared formula is called in a module's kernels, sums fused with products."""
    return f"{formula.__name__}_fused"


def _primitive(formula: Formula, of_numbers: Formula | None = None) -> Formula:
    """Decorate a function of numbers and arrays that is an operation of a record, under its own name."""
    function = _asking(formula, of_numbers or formula)
    _PRIMITIVES[function] = formula.__name__
    return function


def _asking(formula: Formula, of_numbers: Formula) -> Formula:
    """Extend the formula to symbols, by `Symbol.apply`; single numbers take another one, without numpy's detours."""

    @wraps(formula)
    def function(*arguments: Any) -> Any:
        if _NUMBERS.issuperset(map(type, arguments)):
            return of_numbers(*arguments)
        symbols = [argument for argument in arguments if isinstance(argument, Symbol)]
        return max(symbols, key=lambda one: one.rank).apply(function, arguments) if symbols else formula(*arguments)

    return function


def _code(operand: Any) -> int | str:
    return operand.index if isinstance(operand, Expression) else repr(float(operand))


def is_literal(operand: Any, value: float) -> bool:
    """Return whether an operand is this number, known when a record is made."""
    return isinstance(operand, int | float) and float(operand) == value


@_primitive
def floor(x: Any) -> Any:
    """Return the largest integer not above x, as a float."""
    return np.floor(x)


@_called("quarter_turns", 2, scalars.quarter_turns)
def quarter_turns(k: Any, sine: Any, cosine: Any) -> tuple[Any, Any]:
    """Return the sine and cosine of an angle k quarter turns on; k is a whole number, as a float.

    Kernels have an intrinsic for it (`intrinsics.quarter_turns`), which spares the processor's multipliers.
    """
    quarter = k - 4.0 * np.floor(k * 0.25)  # 0, 1, 2, 3
    half = np.floor(quarter * 0.5)  # 1 in the lower half plane
    swap = quarter - 2.0 * half  # 1 where sine and cosine change roles
    sign = 1.0 - 2.0 * half
    odd = np.asarray(swap) > 0.5
    return sign * np.where(odd, cosine, sine)[()], sign * (1.0 - 2.0 * swap) * np.where(odd, sine, cosine)[()]


@_primitive
def root(x: Any) -> Any:
    """Return the square root."""
    return np.sqrt(x)


@_primitive
def magnitude(x: Any) -> Any:
    """Return the absolute value."""
    return np.abs(x)


@partial(_primitive, of_numbers=scalars.where_less)
def where_less(x: Any, bound: Any, then: Any, otherwise: Any) -> Any:
    """Return `then` where x < bound, else `otherwise`; NaN is not less."""
    return np.where(np.asarray(x) < bound, then, otherwise)[()]


@_primitive
def clip(x: Any, low: Any, high: Any) -> Any:
    """Return x limited to [low, high]; NaN stays NaN."""
    return np.clip(x, low, high)


@_primitive
def at_least(x: Any, low: float) -> Any:
    """Return the larger of x and low; NaN stays NaN."""
    return np.maximum(x, low)
