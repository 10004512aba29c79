"""A record in vectors of lanes gives the numbers of the plain formulas."""

from functools import partial
from typing import Any

import numpy as np
import pytest

from flexarm_env.codegen import compiler
from flexarm_env.codegen.arrays import LaneRows
from flexarm_env.codegen.declarations import Program, plain_python
from flexarm_env.codegen.elementary import arctan2, exp_minus, sincos
from flexarm_env.codegen.rows import lane_rows
from flexarm_env.codegen.tracing import at_least, clip, floor, magnitude, root, where_less
from flexarm_env.kernels.recorder import Recorder, recorded_by
from flexarm_env.kernels.variants import Variant, variant


def formula(a: Any, b: Any, h: Any) -> list[Any]:
    """Every operation that a record may hold."""
    plain = [a + b, a - b, -a, a * b, a / b, h * a, 2.0 - b, a * b + h, h - a * b, a * b - h]
    chosen = [where_less(a, b, a, 3.0), clip(a, -0.5, b), at_least(a, 0.25), magnitude(a), floor(4.0 * a), root(b)]
    return [*plain, *chosen, *sincos(9.0 * a), exp_minus(b), arctan2(a, b), arctan2(-b, a)]


@recorded_by(partial(Recorder, inlining=True))
def kernel(r: Recorder, rows: LaneRows, results: LaneRows, h: float) -> None:
    """All results of `formula` on every lane."""
    r.store("results", formula(*r.rows_of("rows", 2), h))


def run(rows: LaneRows, results: LaneRows, h: float) -> None:
    kernel(lane_rows(rows, variant.lanes), lane_rows(results, variant.lanes), h)


@pytest.mark.parametrize("lanes", [1, 2, 24])
def test_a_kernel_in_vectors_is_the_formula(lanes: int) -> None:
    """Compiled and in plain Python."""
    of = Variant(Program("vectors", (run,)), 1, True, lanes)
    rows = np.random.default_rng(0).uniform(-1.0, 1.0, (2, lanes))
    rows[1] = np.abs(rows[1]) + 0.1
    expected = [np.broadcast_to(value, lanes) for value in formula(*rows, 0.7)]
    compiled, plain = np.zeros((2, len(expected), lanes))
    compiler.load(of).run(rows, compiled, 0.7)
    with plain_python(of):
        run(rows, plain, 0.7)
    for found in (compiled, plain):
        np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-15)  # fused sums are rounded once
