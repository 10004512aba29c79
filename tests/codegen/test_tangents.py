"""Dual numbers: the rule of each operation and function against central differences, and what is recorded of them."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from flexarm_env.codegen import tangents, tracing
from flexarm_env.codegen.elementary import arctan2, exp_minus, sincos
from flexarm_env.codegen.tangents import Dual, value, varied
from flexarm_env.codegen.tracing import Trace, at_least, clip, floor, magnitude, quarter_turns, root, where_less

numbers = st.floats(0.3, 3.0)
FUNCTIONS: dict[str, Callable[[Any, Any], Any]] = {
    "sum": lambda a, b: 2.0 + (a + b) + 1.5,
    "difference": lambda a, b: 2.0 - (a - b) - 1.5,
    "product": lambda a, b: 3.0 * a * b * 0.5 * 0.0 + a * (b * a) * 2.0,
    "quotient": lambda a, b: a / b + 2.0 / a + b / 4.0,
    "negative": lambda a, b: -(a * -b),
    "sine": lambda a, b: sincos(a * b)[0],
    "cosine": lambda a, b: sincos(a - b)[1],
    "exponential": lambda a, b: exp_minus(a * b),
    "exponential beyond its range": lambda a, b: exp_minus(-a) * b,
    "angle": arctan2,
    "angle of a number": lambda a, b: arctan2(2.0, a * b),
    "root": lambda a, b: root(a + b * b),
    "magnitude": lambda a, b: magnitude(-a * b),
    "floor": lambda a, b: a - 10.0 * floor(0.01 * b),
    "choice": lambda a, b: where_less(a, 5.0, a * b, 7.0),
    "other choice": lambda a, b: where_less(a, -5.0, a * b, b),
    "within": lambda a, b: clip(a * b, -100.0, 100.0),
    "beyond": lambda a, b: clip(20.0 + a, -1.0, b),
    "below": lambda a, b: clip(-20.0 - a, -b, 1.0),
    "at least": lambda a, b: at_least(a, b - 10.0) + at_least(a - 10.0, b),
    "turned": lambda a, b: quarter_turns(3.0, a, a * b)[0] + 2.0 * quarter_turns(2.0, a, b)[1],
}


@pytest.mark.parametrize("name", FUNCTIONS)
@given(a=numbers, b=numbers)
def test_tangents_are_limits_of_differences(name: str, a: float, b: float) -> None:
    function, h = FUNCTIONS[name], 1e-5
    found = function(*varied((a, b), "ab"))
    assert value(found) == pytest.approx(function(a, b), rel=1e-15)
    for way, (da, db) in {"a": (h, 0.0), "b": (0.0, h)}.items():
        expected = (function(a + da, b + db) - function(a - da, b - db)) / (2.0 * h)
        assert tangents.tangents(found).get(way, 0.0) == pytest.approx(expected, rel=1e-7, abs=1e-7)


def test_every_function_that_can_be_recorded_has_a_rule() -> None:
    assert set(tangents._RULES) == {*tracing._PRIMITIVES, *tracing._CALLED}


def test_what_does_not_vary_costs_nothing() -> None:
    trace = Trace()
    a, b = map(trace.number, "ab")
    varies = Dual(a, {"a": 1.0})
    assert (varies + b).tangents == {"a": 1.0}
    assert (b - varies).tangents["a"] == -1.0
    assert (varies * b).tangents["a"] is b
    assert 0.0 * varies == varies * 0.0 == 0.0
    before = len(trace._operations)
    assert value((varies * b) * 1.0) is trace.assign("multiply", a, b)
    assert len(trace._operations) == before


def test_tangents_may_be_arrays_of_directions() -> None:
    x = Dual(np.array([0.5, 2.0]), {None: np.array([[1.0], [3.0]])})
    sine, _ = sincos(x * x)
    expected = np.array([[1.0], [3.0]]) * 2.0 * x.value * np.cos(x.value**2)
    np.testing.assert_allclose(sine.tangents[None], expected, rtol=1e-14)
