"""What the recorder notes: which sums it fuses with a product, and that they are the same sums."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from flexarm_env.codegen.plain import python_kernel
from flexarm_env.codegen.tracing import Recording, Trace
from tests.support.rounding import rounded_once

Formula = Callable[[Any, Any, Any], list[Any]]


def recorded(formula: Formula, fusing: bool = True) -> Recording:
    trace = Trace()
    return trace.recording("abc", formula(*map(trace.number, "abc")), fusing=fusing)


def arithmetic(recording: Recording) -> list[str]:
    return [operation.name for operation in recording.operations if operation.operands]


def value(formula: Formula, *numbers: float) -> list[float]:
    """Run a recording with its products and sums rounded together."""
    stored = recorded(formula)._replace(places=[("results", 0)], parameters=("results", "a", "b", "c"))
    results = np.zeros((1, 1))
    python_kernel(stored, 1, rounded_once)(results, *numbers)
    return [float(results[0, 0])]


@pytest.mark.parametrize(
    ("formula", "operation", "c"),
    [
        (lambda a, b, c: [a * b + c], "multiply_add", -1.0),
        (lambda a, b, c: [c + a * b], "multiply_add", -1.0),
        (lambda a, b, c: [a * b - c], "multiply_subtract", 1.0),
        (lambda a, b, c: [c - a * b], "multiply_subtract_from", 1.0),
        (lambda a, b, c: [a * (1.0 - 2.0**-30) + c], "multiply_add", -1.0),
    ],
    ids=["product first", "product last", "less c", "less the product", "a literal"],
)
def test_a_sum_with_a_product_is_fused(formula: Formula, operation: str, c: float) -> None:
    """The product is 1 - 2^-60: rounded by itself it is 1, and the sum 0."""
    assert arithmetic(recorded(formula)) == [operation]
    a, b = 1.0 + 2.0**-30, 1.0 - 2.0**-30
    assert formula(a, b, c) == [0.0]
    assert [abs(x) for x in value(formula, a, b, c)] == [2.0**-60]


@pytest.mark.parametrize(
    "formula",
    [
        lambda a, b, c: [a * b + c, a * b - c],  # two sums: the product is shared
        lambda a, b, c: [a * b + c, a * b],  # the product is a result
        lambda a, b, c: [(a * b + c) * (a * b)],  # a sum and a product
        lambda a, b, c: [a * b + a * b],
    ],
    ids=["two sums", "a result", "a product too", "twice in one sum"],
)
def test_a_product_that_is_used_twice_is_rounded_by_itself(formula: Formula) -> None:
    assert set(arithmetic(recorded(formula))) <= {"multiply", "add", "subtract"}


def test_of_two_products_one_is_fused_and_nothing_without_fusing() -> None:
    assert arithmetic(recorded(lambda a, b, c: [a * b + b * c])) == ["multiply", "multiply_add"]
    assert arithmetic(recorded(lambda a, b, c: [a * b + c], fusing=False)) == ["multiply", "add"]


def test_an_argument_of_a_call_is_rounded_by_itself() -> None:
    trace = Trace()
    a, b, c = map(trace.number, "abc")
    product = a * b
    (called,) = trace.call("f", [product], 1)
    assert arithmetic(trace.recording("abc", [product + c, called])) == ["multiply", "call", "result", "add"]


def test_a_recording_has_what_its_results_need_once() -> None:
    def formula(a: Any, b: Any, c: Any) -> list[Any]:
        _ = a / c
        return [a + b, 2.0 * (a + b)]

    recording = recorded(formula)
    assert arithmetic(recording) == ["add", "multiply"]
    assert recording.operations[-1].operands == ("2.0", 2)
    assert recording.results == [2, 3]
