"""Declarations of rows and drivers, and how the compiler takes them."""

from math import tan

import numpy as np
import pytest

from flexarm_env.codegen import compiler
from flexarm_env.codegen.arrays import LaneRows
from flexarm_env.codegen.declarations import Names, Program, plain_python
from flexarm_env.codegen.rows import lane_rows
from flexarm_env.kernels.entries import Constant
from flexarm_env.kernels.layout import Row, row
from flexarm_env.kernels.rk4 import OPEN
from flexarm_env.kernels.stamp import TABLES
from flexarm_env.kernels.variants import Variant, variant


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__name__)
def test_each_place_says_what_it_is_and_in_which_unit(table: type[Names]) -> None:
    assert table.entries
    assert [part.name for part in table.entries if not (part.meaning and part.unit)] == []


def test_mode_shapes_are_in_metres() -> None:
    """Modal coordinates have no unit (`physics.link_modes`)."""
    shapes = {"VALUES": "m", "SLOPES": "1", "FORESHORTENING": "m", "STIFFNESS_1": "N m", "DAMPING_1": "N m s"}
    units = {ending: {p.unit for t in TABLES for p in t.entries if p.name.endswith(f"_{ending}")} for ending in shapes}
    units |= {part.name: {part.unit} for part in Constant.entries if part.name in shapes}
    units["SLOPES"].discard(Row.OUTPUT_SLOPES.unit)  # derivatives of what sensors read
    assert units == {ending: {unit} for ending, unit in shapes.items()}


def driver_of_the_aim(memory: LaneRows) -> None:
    arena = lane_rows(memory, variant.lanes)
    for i in range(variant.lanes):
        arena[row.SHIFT, i] = 1.0


def guarded_driver_of_the_aim(memory: LaneRows) -> None:
    if variant.tracking:
        driver_of_the_aim(memory)


def test_a_row_that_a_program_lacks_is_an_error_unless_nothing_reads_it() -> None:
    arena = np.zeros((50, 1))
    bare = compiler.load(Variant(Program("bare", (driver_of_the_aim,)), 1, True, 1))
    with pytest.raises(LookupError, match=r"driver_of_the_aim: Row\.SHIFT: .*'bare'"):
        bare.driver_of_the_aim(arena)
    guarded = compiler.load(Variant(Program("guarded", (guarded_driver_of_the_aim,)), 1, True, 1))
    guarded.guarded_driver_of_the_aim(arena)
    assert not arena.any()


def driver_with_a_library_function(x: float) -> float:
    return tan(x)


def test_an_elementary_function_of_a_library_is_refused() -> None:
    with pytest.raises(TypeError, match="tan of a library"):
        compiler.load(Variant(Program("bare", (driver_with_a_library_function,)), 1, True, 1))


def use_rows(memory: LaneRows, found: LaneRows) -> int:
    """Read and write rows of lanes in every way that drivers do."""
    rows, results = lane_rows(memory, variant.lanes), lane_rows(found, variant.lanes)
    part, one, last = rows[1:3], rows[2], variant.lanes - 1
    for i in range(variant.lanes):
        results[0, i] = rows[3, i] + part[0, i]
        results[1, i] += one[i]
    one[last] = 7
    results[2, 0] = rows[:, last:][0, 0]
    if variant.batch and last > 1:
        results[2, 1] = 5.0
    return rows.shape[0] + 100 * part.shape[0] + 10_000 * part.shape[1]


@pytest.mark.parametrize("lanes", [1, 3])
def test_compiled_rows_are_arrays_of_rows_and_lanes(lanes: int) -> None:
    of = Variant(Program("rows", (use_rows,)), 1, True, lanes)
    memory = np.random.default_rng(0).normal(size=(4, lanes))
    runs = [(memory.copy(), np.ones((3, lanes))) for _ in range(2)]
    shape = compiler.load(of).use_rows(*runs[0])
    with plain_python(of):
        assert use_rows(*runs[1]) == shape
    for found, expected in zip(*runs, strict=True):
        np.testing.assert_array_equal(found, expected)


def test_drivers_need_a_variant() -> None:
    with pytest.raises(RuntimeError, match="plain_python"):
        driver_of_the_aim(np.zeros((50, 1)))
    with plain_python(Variant(OPEN, 1, True, 1)), pytest.raises(LookupError, match=r"Row\.SHIFT: .*'open'"):
        driver_of_the_aim(np.zeros((50, 1)))
