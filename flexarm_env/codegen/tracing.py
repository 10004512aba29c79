"""Records what a function of numbers does and writes it down as straight-line code.

The physics is written once, as plain functions with loops over modes and matrices (`dynamics`, `jacobian_transpose`).
Called with floats or numpy arrays these functions compute. Called with `Expression` objects they are recorded,
and the record is compiled: loops over modes are gone, shared subexpressions are computed once, and the compiler
can vectorise the result over the environments of a batch. No operation is reordered, but a product that one sum alone
uses is fused with it (`intrinsics.fused`): rounded once, in one instruction, wherever the code runs.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import wraps
from inspect import unwrap
from typing import Any

import numpy as np

_DEEPEST = 12  # nesting of a written expression; Python's parser and readers have limits
_PRODUCT = "{0} * {1}"
# Sums and differences, which operand may be a product, and what they are with it: its factors are 0 and 1, the other 2.
_FUSED = (
    ("{0} + {1}", 1, "fused({0}, {1}, {2})"),
    ("{0} + {1}", 0, "fused({0}, {1}, {2})"),
    ("{0} - {1}", 1, "fused(-{0}, {1}, {2})"),
    ("{0} - {1}", 0, "fused({0}, {1}, -{2})"),
)
_Operation = tuple[str, tuple[str, ...]]


class Trace:
    """A growing list of operations, each on inputs, literals and earlier operations."""

    def __init__(self, inlining: bool = False) -> None:
        """Start empty.

        Args:
            inlining: formulas that are recorded once elsewhere (`recorded_once`) become part of this record.
        """
        self.inlining = inlining
        self._operations: list[_Operation] = []
        self._known: dict[_Operation, Expression] = {}
        self._arguments: set[str] = set()  # of calls

    def input(self, code: str) -> Expression:
        """Record a value that the surrounding code provides, e.g. an array element."""
        return self.assign(code)

    def inputs(self, codes: Sequence[str]) -> list[Expression]:
        """Record several inputs at once."""
        return [self.input(code) for code in codes]

    def assign(self, template: str, *operands: str) -> Expression:
        """Record one operation, or find it if it was recorded before."""
        operation = (template, operands)
        known = self._known.get(operation)
        if known is None:
            known = Expression(self, f"x{len(self._operations)}")
            self._operations.append(operation)
            self._known[operation] = known
        return known

    def call(self, function: str, arguments: Sequence[Any], count: int) -> list[Expression]:
        """Record a call of a function that returns `count` numbers."""
        codes = [_code(argument) for argument in arguments]
        self._arguments.update(codes)
        places = ", ".join(f"{{{place}}}" for place in range(len(codes)))
        called = self.assign(f"{function}({places})", *codes)
        return [self.assign(f"{{0}}[{n}]", called.name) for n in range(count)]

    def reads(self, name: str) -> bool:
        """Whether a value that the surrounding code provides is an argument of this name, or an element of it."""
        return any(template.split("[")[0] == name for template, operands in self._operations if not operands)

    def lines(self, results: Sequence[Any], fusing: bool = True) -> list[str]:
        """Write assignments that compute the results, each under its own name; what no result needs is left out.

        An operation used once is written inside the one that uses it: fewer names, which the compiler's time grows
        with. Results always get a name, so that all inputs are read before the surrounding code writes anything; so do
        arguments of calls (numba does not read a long call with a choice inside). `fusing`: sums with products.
        """
        named = self._arguments | {result.name for result in results if isinstance(result, Expression)}
        operations = self._fused(results, named) if fusing else self._operations
        uses = _uses(operations, results)
        written: dict[str, tuple[str, int]] = {}  # code and nesting of operations without a name
        lines = []
        for index, (template, operands) in enumerate(operations):
            name = f"x{index}"
            if name not in uses:
                continue
            inner = [written.get(operand, (operand, 0)) for operand in operands]
            code = template.format(*(f"({text})" if nesting else text for text, nesting in inner))
            nesting = 1 + max((nesting for _, nesting in inner), default=0)
            if uses[name] == 1 and name not in named and nesting < _DEEPEST:
                written[name] = (code, nesting)
            else:
                lines.append(f"{name} = {code}")
        return lines

    def needed(self, results: Sequence[Any], fusing: bool = True) -> list[tuple[str, str, tuple[str, ...]]]:
        """Return the operations that the results need: name, template, operands; `fusing` as in `lines`."""
        named = self._arguments | {result.name for result in results if isinstance(result, Expression)}
        operations = self._fused(results, named) if fusing else self._operations
        uses = _uses(operations, results)
        return [(f"x{n}", *operation) for n, operation in enumerate(operations) if f"x{n}" in uses]

    def _fused(self, results: Sequence[Any], named: set[str]) -> list[_Operation]:
        """Merge each sum with a product that nothing else uses."""
        uses = _uses(self._operations, results)
        products = {
            f"x{index}": operands
            for index, (template, operands) in enumerate(self._operations)
            if template == _PRODUCT and uses.get(f"x{index}") == 1 and f"x{index}" not in named
        }
        fused = []
        for template, operands in self._operations:
            for sum_or_difference, place, merged in _FUSED:
                if template == sum_or_difference and operands[place] in products:
                    template, operands = merged, (*products[operands[place]], operands[1 - place])
                    break
            fused.append((template, operands))
        return fused


def _uses(operations: Sequence[_Operation], results: Sequence[Any]) -> dict[str, int]:
    """Return how often each needed operation is used; the results count once more."""
    uses: dict[str, int] = {}
    for result in results:
        if isinstance(result, Expression):
            uses[result.name] = uses.get(result.name, 0) + 1
    for index in reversed(range(len(operations))):
        template, operands = operations[index]
        if f"x{index}" in uses:
            for place, operand in enumerate(operands):
                uses[operand] = uses.get(operand, 0) + template.count(f"{{{place}}}")
    return uses


class Symbol(ABC):
    """A number of another kind than floats and arrays; the functions of this module ask it what they give.

    Attributes:
        rank: of symbols of two kinds in one call, that of the higher rank is asked.
    """

    __slots__ = ()
    __array_ufunc__ = None  # numpy numbers defer to the reflected operators
    rank = 0

    @abstractmethod
    def apply(self, function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
        """Apply a function of this module, or one recorded once, to arguments of which this symbol is one."""


def _asked(arguments: Sequence[Any]) -> Symbol | None:
    """Return the symbol of the highest rank among the arguments, or None."""
    symbols = [argument for argument in arguments if isinstance(argument, Symbol)]
    return max(symbols, key=lambda symbol: symbol.rank) if symbols else None


class Expression(Symbol):
    """A number that is not known yet; arithmetic on it is recorded."""

    __slots__ = ("name", "trace")

    def __init__(self, trace: Trace, name: str) -> None:
        """Made by `Trace` only."""
        self.trace = trace
        self.name = name

    def _record(self, template: str, *operands: Any) -> Any:
        """Record the operation; return NotImplemented if an operand has a higher rank."""
        if any(isinstance(operand, Symbol) and operand.rank > self.rank for operand in operands):
            return NotImplemented
        return self.trace.assign(template, *(_code(operand) for operand in operands))

    def apply(self, function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
        """Record a primitive, or a call."""
        template = _PRIMITIVES.get(function)
        if template is not None:
            return self._record(template, *arguments)
        name, count = _CALLED[function]
        if self.trace.inlining and name == recorded_name(function):
            return unwrap(function)(*arguments)
        results = self.trace.call(name, arguments, count)
        return tuple(results) if count > 1 else results[0]

    def __add__(self, other: Any) -> Any:
        """Sum; adding a literal zero records nothing."""
        return self if _is(other, 0.0) else self._record("{0} + {1}", self, other)

    def __radd__(self, other: Any) -> Any:
        """Reflected sum."""
        return self if _is(other, 0.0) else self._record("{0} + {1}", other, self)

    def __sub__(self, other: Any) -> Any:
        """Difference."""
        return self if _is(other, 0.0) else self._record("{0} - {1}", self, other)

    def __rsub__(self, other: Any) -> Any:
        """Reflected difference."""
        return -self if _is(other, 0.0) else self._record("{0} - {1}", other, self)

    def __mul__(self, other: Any) -> Any:
        """Product; a literal zero or one records nothing."""
        if _is(other, 0.0) or _is(other, 1.0):
            return 0.0 if _is(other, 0.0) else self
        return self._record(_PRODUCT, self, other)

    def __rmul__(self, other: Any) -> Any:
        """Reflected product."""
        if _is(other, 0.0) or _is(other, 1.0):
            return 0.0 if _is(other, 0.0) else self
        return self._record(_PRODUCT, other, self)

    def __truediv__(self, other: Any) -> Any:
        """Quotient."""
        return self._record("{0} / {1}", self, other)

    def __rtruediv__(self, other: Any) -> Any:
        """Reflected quotient."""
        return self._record("{0} / {1}", other, self)

    def __neg__(self) -> Any:
        """Negative."""
        return self._record("-{0}", self)


_PRIMITIVES: dict[Callable[..., Any], str] = {}  # how they are written
_CALLED: dict[Callable[..., Any], tuple[str, int]] = {}  # their names in kernels, and how many results they have


def recorded_once(count: int) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorate a formula of several numbers that a module's kernels share: a record calls it.

    Compiling takes longer the more there is to read; a sine has fifty operations, and a step of the arm eight sines.

    Args:
        count: number of the formula's results.
    """
    return lambda formula: _called(recorded_name(formula), count)(formula)


def _called(name: str, count: int) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorate a function of numbers and arrays that a record calls by a name."""

    def decorated(formula: Callable[..., Any]) -> Callable[..., Any]:
        """Make the function for symbols too."""
        function = _asking(formula)
        _CALLED[function] = name, count
        return function

    return decorated


def recorded_name(formula: Callable[..., Any]) -> str:
    """Return what a shared formula is called in a module's kernels, sums fused with products."""
    return f"{formula.__name__}_fused"


def _primitive(template: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Decorate a function of numbers and arrays that a record writes as `template`."""

    def decorated(formula: Callable[..., Any]) -> Callable[..., Any]:
        """Make the function for symbols too."""
        function = _asking(formula)
        _PRIMITIVES[function] = template
        return function

    return decorated


def _asking(formula: Callable[..., Any]) -> Callable[..., Any]:
    """Extend the formula to symbols, by `Symbol.apply`."""

    @wraps(formula)
    def function(*arguments: Any) -> Any:
        """Compute, or ask the symbol."""
        symbol = _asked(arguments)
        return formula(*arguments) if symbol is None else symbol.apply(function, arguments)

    return function


def _code(operand: Any) -> str:
    return operand.name if isinstance(operand, Expression) else repr(float(operand))


def _is(operand: Any, value: float) -> bool:
    return isinstance(operand, int | float) and float(operand) == value


@_primitive("floor({0})")
def floor(x: Any) -> Any:
    """Return the largest integer not above x, as a float."""
    return np.floor(x)


@_called("quarter_turns", 2)
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


@_primitive("sqrt({0})")
def root(x: Any) -> Any:
    """Return the square root."""
    return np.sqrt(x)


@_primitive("abs({0})")
def magnitude(x: Any) -> Any:
    """Return the absolute value."""
    return np.abs(x)


@_primitive("({2} if {0} < {1} else {3})")
def where_less(x: Any, bound: Any, then: Any, otherwise: Any) -> Any:
    """Return `then` where x < bound, else `otherwise`; NaN is not less."""
    return np.where(np.asarray(x) < bound, then, otherwise)[()]


@_primitive("({1} if {0} < {1} else ({2} if {0} > {2} else {0}))")
def clip(x: Any, low: Any, high: Any) -> Any:
    """Return x limited to [low, high]; NaN stays NaN."""
    return np.clip(x, low, high)


@_primitive("({1} if {0} < {1} else {0})")
def at_least(x: Any, low: float) -> Any:
    """Return the larger of x and low; NaN stays NaN."""
    return np.maximum(x, low)
