"""Dual numbers: values with their derivatives along chosen directions, carried through plain formulas.

A dual number holds a value and, for each direction in which it varies, its derivative (its *tangent*). Values and
tangents are numbers of any kind: floats, numpy arrays, or expressions of a record (`tracing`), so that one writing of a
formula gives its derivatives as well, computed or recorded. A direction along which nothing varies is left out, so
zeros cost nothing.

Source: Griewank & Walther, *Evaluating Derivatives*, 2nd edition, SIAM 2008, chapter 3 (tangent mode).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.elementary import arctan2, exp_minus, sincos
from flexarm_env.codegen.tracing import (
    Symbol,
    at_least,
    clip,
    floor,
    is_literal,
    magnitude,
    quarter_turns,
    root,
    where_less,
)

Tangents = Mapping[Any, Any]
Array = NDArray[np.float64]


class Dual(Symbol):
    """A number that varies; arithmetic on it follows the rules of differentiation, and a literal 0 leaves 0.

    Attributes:
        value: at the point.
        tangents: derivative along each direction; a direction that is not among them has none.
    """

    __slots__ = ("tangents", "value")
    rank = 1

    def __init__(self, value: Any, tangents: Tangents) -> None:
        self.value = value
        self.tangents = tangents

    def apply(self, function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
        """Apply the function's rule of differentiation."""
        return _RULES[function](*arguments)

    def __add__(self, other: Any) -> Any:
        return Dual(self.value + value(other), _sum(self.tangents, tangents(other)))

    def __radd__(self, other: Any) -> Any:
        return Dual(other + self.value, self.tangents)

    def __sub__(self, other: Any) -> Any:
        return Dual(self.value - value(other), _difference(self.tangents, tangents(other)))

    def __rsub__(self, other: Any) -> Any:
        return Dual(other - self.value, _difference({}, self.tangents))

    def __mul__(self, other: Any) -> Any:
        if is_literal(other, 0.0):
            return 0.0
        own, others = _scaled(self.tangents, value(other)), _scaled(tangents(other), self.value)
        return Dual(self.value * value(other), _sum(own, others))

    def __rmul__(self, other: Any) -> Any:
        return 0.0 if is_literal(other, 0.0) else Dual(other * self.value, _scaled(self.tangents, other))

    def __truediv__(self, other: Any) -> Any:
        reciprocal = 1.0 / value(other)
        quotient = self.value / value(other)
        others = _scaled(tangents(other), -(quotient * reciprocal))
        return Dual(quotient, _sum(_scaled(self.tangents, reciprocal), others))

    def __rtruediv__(self, other: Any) -> Any:
        quotient = other / self.value
        return Dual(quotient, _scaled(self.tangents, -(quotient / self.value)))

    def __neg__(self) -> Any:
        return Dual(-self.value, _scaled(self.tangents, -1.0))


def value(number: Any) -> Any:
    """Return the value of a number, dual or not."""
    return number.value if isinstance(number, Dual) else number


def tangents(number: Any) -> Tangents:
    """Return the tangents of a number; a number that is not dual has none."""
    return number.tangents if isinstance(number, Dual) else {}


def varied(values: Sequence[Any], directions: Sequence[Any]) -> list[Dual]:
    """Return dual numbers of which each varies along a direction of its own, with derivative one."""
    return [Dual(number, {direction: 1.0}) for number, direction in zip(values, directions, strict=True)]


def jacobian(function: Callable[[list[Any]], Sequence[Any]], point: Array) -> tuple[Array, Array]:
    """Return values and derivatives of a plain formula at one point or at many.

    Args:
        function: function of some numbers that returns some numbers.
        point: Shape (..., numbers).

    Returns:
        Values, Shape (..., results), and derivatives, Shape (..., results, numbers).
    """
    *leading, count = point.shape
    ways = np.eye(count).reshape(count, count, *(1 for _ in leading))
    numbers = [Dual(x, {None: way}) for x, way in zip(np.moveaxis(point, -1, 0), ways, strict=True)]
    results = function(numbers)
    values = [np.broadcast_to(value(result), leading) for result in results]
    slopes = [np.broadcast_to(tangents(result).get(None, 0.0), (count, *leading)) for result in results]
    return np.stack(values, axis=-1), np.moveaxis(np.stack(slopes), (0, 1), (-2, -1))


def _sum(one: Tangents, two: Tangents) -> Tangents:
    if not one or not two:
        return one or two
    return {**one, **{way: one[way] + tangent if way in one else tangent for way, tangent in two.items()}}


def _difference(one: Tangents, two: Tangents) -> Tangents:
    """Subtract along each direction: a record fuses a difference with a product, but not a product's negative."""
    return {**one, **{way: one[way] - tangent if way in one else -tangent for way, tangent in two.items()}}


def _scaled(given: Tangents, factor: Any) -> Tangents:
    """Each tangent times a factor; literal zeros and ones leave no product behind."""
    if is_literal(factor, 0.0):
        return {}
    if is_literal(factor, -1.0):
        return {way: -tangent for way, tangent in given.items()}
    return {way: factor if is_literal(tangent, 1.0) else tangent * factor for way, tangent in given.items()}


# --- rules: a function's value, with tangents from its partial derivatives or from the branch that it takes -----------


def _smooth(result: Any, *terms: tuple[Any, Any]) -> Dual:
    """Combine a value with its arguments' tangents, each times a partial derivative; terms: argument, partial."""
    total: Tangents = {}
    for argument, partial in terms:
        total = _sum(total, _scaled(tangents(argument), partial))
    return Dual(result, total)


def _along(function: Callable[..., Any], *arguments: Any) -> dict[Any, Any]:
    """Apply a function to the arguments' tangents, along each direction in which one of them varies."""
    ways = {way: None for argument in arguments for way in tangents(argument)}
    return {way: function(*(tangents(argument).get(way, 0.0) for argument in arguments)) for way in ways}


def _sincos(x: Dual) -> tuple[Dual, Dual]:
    sine, cosine = sincos(x.value)
    return _smooth(sine, (x, cosine)), _smooth(cosine, (x, -sine))


def _quarter_turns(k: Any, sine: Any, cosine: Any) -> tuple[Dual, Dual]:
    """Turn value and tangents alike: the number of turns is locally constant, and the turn is linear."""
    turned = quarter_turns(value(k), value(sine), value(cosine))
    ways = _along(lambda a, b: quarter_turns(value(k), a, b), sine, cosine)
    first, second = ({way: pair[n] for way, pair in ways.items()} for n in (0, 1))
    return Dual(turned[0], first), Dual(turned[1], second)


def _exp_minus(x: Dual) -> Dual:
    """Beyond its range the function is constant."""
    result = exp_minus(x.value)
    slope = where_less(x.value, 0.0, 0.0, where_less(700.0, x.value, 0.0, -result))
    return _smooth(result, (x, slope))


def _arctan2(y: Any, x: Any) -> Dual:
    per_square = 1.0 / (value(x) * value(x) + value(y) * value(y))
    return _smooth(arctan2(value(y), value(x)), (y, value(x) * per_square), (x, -(value(y) * per_square)))


def _floor(x: Dual) -> Any:
    """Locally constant."""
    return floor(x.value)


def _root(x: Dual) -> Dual:
    result = root(x.value)
    return _smooth(result, (x, 0.5 / result))


def _magnitude(x: Dual) -> Dual:
    return Dual(magnitude(x.value), _along(lambda a: where_less(x.value, 0.0, -a, a), x))


def _where_less(x: Any, bound: Any, then: Any, otherwise: Any) -> Dual:
    """Choose the value, and along each direction the chosen number's tangent."""
    at = value(x), value(bound)
    return Dual(
        where_less(*at, value(then), value(otherwise)), _along(lambda a, b: where_less(*at, a, b), then, otherwise)
    )


def _clip(x: Any, low: Any, high: Any) -> Dual:
    at = value(x), value(low), value(high)
    chosen = _along(lambda a, b, c: where_less(at[0], at[1], b, where_less(at[2], at[0], c, a)), x, low, high)
    return Dual(clip(*at), chosen)


def _at_least(x: Any, low: Any) -> Dual:
    at = value(x), value(low)
    return Dual(at_least(*at), _along(lambda a, b: where_less(*at, b, a), x, low))


_RULES: dict[Callable[..., Any], Callable[..., Any]] = {
    sincos: _sincos,
    exp_minus: _exp_minus,
    arctan2: _arctan2,
    quarter_turns: _quarter_turns,
    floor: _floor,
    root: _root,
    magnitude: _magnitude,
    where_less: _where_less,
    clip: _clip,
    at_least: _at_least,
}
