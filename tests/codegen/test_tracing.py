"""What the recorder writes down: which sums it fuses with a product, and that they are the same sums."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import pytest

from flexarm_env.codegen.tracing import Trace

Formula = Callable[[Any, Any, Any], list[Any]]


def written(formula: Formula) -> tuple[list[str], list[Any]]:
    """Lines and results of a formula of a, b and c."""
    trace = Trace()
    results = formula(*trace.inputs(["a", "b", "c"]))
    return trace.lines(results), results


def value(formula: Formula, **numbers: float) -> list[float]:
    """Evaluate the written text, products and sums rounded together where it says so."""
    lines, results = written(formula)
    names: dict[str, Any] = {**numbers, "fused": lambda a, b, c: float(Fraction(a) * Fraction(b) + Fraction(c))}
    exec("\n".join(lines), names)
    return [names[result.name] for result in results]


@pytest.mark.parametrize(
    ("formula", "text", "c"),
    [
        (lambda a, b, c: [a * b + c], "fused(x0, x1, x2)", -1.0),
        (lambda a, b, c: [c + a * b], "fused(x0, x1, x2)", -1.0),
        (lambda a, b, c: [a * b - c], "fused(x0, x1, -x2)", 1.0),
        (lambda a, b, c: [c - a * b], "fused(-x0, x1, x2)", 1.0),
        (lambda a, b, c: [a * (1.0 - 2.0**-30) + c], f"fused(x0, {1.0 - 2.0**-30!r}, x2)", -1.0),
    ],
    ids=["product first", "product last", "less c", "less the product", "a literal"],
)
def test_a_sum_with_a_product_is_fused(formula: Formula, text: str, c: float) -> None:
    """The product is 1 - 2^-60: rounded by itself it is 1, and the sum 0."""
    lines, _ = written(formula)
    assert lines[-1].replace("(a)", "x0").replace("(b)", "x1").replace("(c)", "x2").endswith(f"= {text}")
    a, b = 1.0 + 2.0**-30, 1.0 - 2.0**-30
    assert formula(a, b, c) == [0.0]
    assert [abs(x) for x in value(formula, a=a, b=b, c=c)] == [2.0**-60]


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
    lines, _ = written(formula)
    assert not any("fused" in line for line in lines)


def test_of_two_products_one_is_fused() -> None:
    lines, _ = written(lambda a, b, c: [a * b + b * c])
    assert lines[-1].count("fused") == 1
    assert lines[-1].count("*") == 1


def test_nothing_is_fused_if_told_so() -> None:
    trace = Trace()
    a, b, c = trace.inputs(["a", "b", "c"])
    assert trace.lines([a * b + c], fusing=False)[-1] == "x4 = ((a) * (b)) + (c)"


def test_an_argument_of_a_call_is_rounded_by_itself() -> None:
    trace = Trace()
    a, b, c = trace.inputs(["a", "b", "c"])
    product = a * b
    (called,) = trace.call("f", [product], 1)
    lines = trace.lines([product + c, called])
    assert not any("fused" in line for line in lines)
