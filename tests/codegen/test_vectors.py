"""A record in vectors of lanes gives the numbers of the plain formulas."""

from typing import Any

import numpy as np
import pytest

from flexarm_env.codegen import assembly
from flexarm_env.codegen.arrays import LaneRows
from flexarm_env.codegen.declarations import Program, plain_python
from flexarm_env.codegen.elementary import arctan2, exp_minus, sincos
from flexarm_env.codegen.tracing import at_least, clip, floor, magnitude, root, where_less
from flexarm_env.kernels.recorder import Recorder, recorded_kernel
from flexarm_env.kernels.variants import Variant


def formula(a: Any, b: Any, h: Any) -> list[Any]:
    """Every operation that a record may hold."""
    plain = [a + b, a - b, -a, a * b, a / b, h * a, 2.0 - b, a * b + h, h - a * b, a * b - h]
    chosen = [where_less(a, b, a, 3.0), clip(a, -0.5, b), at_least(a, 0.25), magnitude(a), floor(4.0 * a), root(b)]
    return [*plain, *chosen, *sincos(9.0 * a), exp_minus(b), arctan2(a, b), arctan2(-b, a)]


def record(variant: Variant) -> Recorder:
    """Record the formula on two rows."""
    r = Recorder(variant, inlining=True)
    r.store("results", formula(*r.rows_of("rows", 2), r.trace.input("h")))
    return r


@recorded_kernel(record)
def kernel(rows: LaneRows, results: LaneRows, h: float) -> None:
    """All results of `formula` on every lane."""


def run(rows: LaneRows, results: LaneRows, h: float) -> None:
    """Call it as a driver does."""
    kernel(rows, results, h)


@pytest.mark.parametrize("lanes", [1, 2, 24])
def test_a_kernel_in_vectors_is_the_formula(lanes: int) -> None:
    """Compiled and in plain Python."""
    variant = Variant(Program("vectors", (run,)), 1, True, lanes)
    rows = np.random.default_rng(0).uniform(-1.0, 1.0, (2, lanes))
    rows[1] = np.abs(rows[1]) + 0.1
    expected = [np.broadcast_to(value, lanes) for value in formula(*rows, 0.7)]
    compiled, plain = np.zeros((2, len(expected), lanes))
    assembly.load(variant).run(rows.reshape(-1), compiled.reshape(-1), 0.7)
    with plain_python(variant):
        run(rows, plain, 0.7)
    for found in (compiled, plain):
        np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-15)  # fused sums are rounded once


def test_the_modules_text_has_what_writes_the_vectors_without_its_documentation() -> None:
    text = assembly.render(Variant(Program("vectors", (run,)), 1, True, 8))
    assert "@intrinsic\ndef kernel(typing_context, rows, results, h):" in text
    assert "class VectorWriter:\n\n    def __init__(self, context, builder, lanes, functions):" in text
    assert "Any" not in text
