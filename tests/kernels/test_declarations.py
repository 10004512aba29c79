"""Declarations of rows and drivers, and how the assembler lowers them."""

from __future__ import annotations

import ast
import inspect
from math import tan
from typing import Any

import numpy as np
import pytest

from flexarm_env.codegen import assembly
from flexarm_env.codegen.arrays import Arena
from flexarm_env.codegen.declarations import Names, Program, plain_python
from flexarm_env.episode import draws, reset, sensor, step, write_observation
from flexarm_env.episode.step import TRACKING
from flexarm_env.kernels import (
    delay_line,
    imex,
    law,
    layout,
    loop,
    output_jacobians,
    period,
    reference,
    states,
    step_jacobians,
)
from flexarm_env.kernels.layout import row
from flexarm_env.kernels.rk4 import OPEN
from flexarm_env.kernels.stamp import TABLES
from flexarm_env.kernels.variants import Variant, variant


@pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__name__)
def test_each_place_says_what_it_is_and_in_which_unit(table: type[Names]) -> None:
    assert table.entries
    for part in table.entries:
        assert part.meaning, part.name
        assert part.unit, part.name


def test_what_the_law_needs_has_rows() -> None:
    names = {part.name for part in layout.Row.entries}
    assert {field.upper() for field in layout.Law._fields} <= names


def driver_of_the_aim(arena: Arena) -> None:
    """Move the aim of the joint-space law."""
    for i in range(variant.lanes):
        arena[row.SHIFT, i] = 1.0


def guarded_driver_of_the_aim(arena: Arena) -> None:
    """Move it where there is one."""
    if variant.tracking:
        driver_of_the_aim(arena)


def test_a_row_that_a_program_lacks_is_an_error_of_the_assembler() -> None:
    with pytest.raises(LookupError, match=r"driver_of_the_aim: Row\.SHIFT: .*'bare'"):
        assembly.render(Variant(Program("bare", (driver_of_the_aim,)), 1, True, 1))
    text = assembly.render(Variant(Program("guarded", (guarded_driver_of_the_aim,)), 1, True, 1))
    assert "driver_of_the_aim(arena)" not in text.replace("guarded_driver_of_the_aim(arena)", "")


def driver_with_a_library_function(arena: Arena) -> None:
    """Call a function that kernel modules do not import."""
    arena[row.Y, 0] = tan(1.0)


def test_a_library_function_that_kernels_do_not_import_is_refused() -> None:
    with pytest.raises(TypeError, match="tan of a library"):
        assembly.render(Variant(Program("bare", (driver_with_a_library_function,)), 1, True, 1))


def guarded_loop(arena: Arena) -> None:
    """Loop over the lanes only where the first number is positive."""
    for i in range(variant.lanes if arena[row.SHIFT, 0] > 0.0 else 0):
        arena[row.SHIFT + 1, i] = 1.0


def test_a_driver_is_lowered_to_a_flat_arena() -> None:
    program = Program("moved", (driver_of_the_aim, guarded_loop), groups=TRACKING.groups)
    blocks, alone = (Variant(program, 1, True, lanes) for lanes in (8, 1))
    text, first = assembly.render(blocks), blocks.rows["SHIFT"][0]
    assert f"for i in range(VARIANT_LANES):\n        arena[i + {8 * first}] = 1.0" in text
    assert "VARIANT_LANES = 8" in text
    text = assembly.render(alone)  # a loop of a single turn is what it repeats
    assert "def driver_of_the_aim(arena):\n    arena[ROW_SHIFT] = 1.0" in text
    assert f"if arena[ROW_SHIFT] > 0.0:\n        arena[{first + 1}] = 1.0" in text


def test_drivers_need_a_variant() -> None:
    with pytest.raises(RuntimeError, match="plain_python"):
        driver_of_the_aim(np.zeros((50, 1)))
    with plain_python(Variant(OPEN, 1, True, 1)), pytest.raises(LookupError, match=r"Row\.SHIFT: .*'open'"):
        driver_of_the_aim(np.zeros((50, 1)))


DRIVERS = [
    delay_line,
    imex,
    law,
    loop,
    period,
    reference,
    states,
    output_jacobians,
    step_jacobians,
    sensor,
    draws,
    reset,
    write_observation,
    step,
]


@pytest.mark.parametrize("module", DRIVERS, ids=lambda module: module.__name__)
def test_drivers_have_types(module: Any) -> None:
    """No parameter of a driver is anything."""
    for function in (node for node in ast.parse(inspect.getsource(module)).body if isinstance(node, ast.FunctionDef)):
        for argument in function.args.args:
            assert argument.annotation is not None, function.name
            assert ast.unparse(argument.annotation) != "Any", f"{function.name}({argument.arg})"
