"""Runs a recording in plain Python, lane by lane, on Python's own numbers: they take a third of the time of numpy's."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import sqrt
from typing import Any

import numpy as np

from flexarm_env.codegen.scalars import quarter_turns
from flexarm_env.codegen.tracing import Operation, Recording

Fused = Callable[[float, float, float], float]
_TEXTS = {
    "add": "{0} + {1}",
    "subtract": "{0} - {1}",
    "multiply": "{0} * {1}",
    "divide": "quotient({0}, {1})",
    "negate": "-{0}",
    "multiply_add": "{0} * {1} + {2}",  # rounded twice, as all three
    "multiply_subtract_from": "-{0} * {1} + {2}",
    "multiply_subtract": "{0} * {1} - {2}",
    "floor": "floor({0})",
    "root": "sqrt({0})",
    "magnitude": "abs({0})",
    "where_less": "{2} if {0} < {1} else {3}",
    "clip": "{1} if {0} < {1} else ({2} if {0} > {2} else {0})",
    "at_least": "{1} if {0} < {1} else {0}",
}
_FUSED = {
    "multiply_add": "fused({0}, {1}, {2})",
    "multiply_subtract_from": "fused(-{0}, {1}, {2})",
    "multiply_subtract": "fused({0}, {1}, -{2})",
}


def python_kernel(recording: Recording, lanes: int, fused: Fused | None = None) -> Callable[..., None]:
    """Return a kernel as a Python function of arrays of shape (rows, lanes) and numbers.

    Args:
        recording: of the kernel.
        lanes: of a block.
        fused: multiplies and adds; by default the product is rounded too.
    """
    names: dict[str, Any] = {"sqrt": sqrt, "floor": _floor, "quotient": _quotient, "quarter_turns": quarter_turns}
    names["fused"] = fused
    texts = _TEXTS if fused is None else _TEXTS | _FUSED
    for name, function in recording.functions.items():
        inputs, work = _lines(function, texts)
        returned = f"return {', '.join(map(_name, function.results))},"
        _define(name, function.parameters, [*inputs, *work, returned], names)
    inputs, work = _lines(recording, texts)
    for (array, row), code in zip(recording.places, recording.results, strict=True):
        work.append(f"{array}[{row}, i] = {_name(code)}")
    loop = [f"for i in range({lanes}):", *(f"    {line}" for line in work)]
    return _define("kernel", recording.parameters, [*inputs, *loop], names)


def _define(name: str, parameters: Sequence[str], body: Sequence[str], names: dict[str, Any]) -> Callable[..., None]:
    exec(f"def {name}({', '.join(parameters)}):\n" + "".join(f"    {line}\n" for line in body), names)
    defined: Callable[..., None] = names[name]
    return defined


def _lines(recording: Recording, texts: Mapping[str, str]) -> tuple[list[str], list[str]]:
    inputs: list[str] = []
    work: list[str] = []
    for index, operation in enumerate(recording.operations):
        lines = inputs if operation.name == "number" else work
        lines.append(f"x{index} = {_text(operation, texts)}")
    return inputs, work


def _text(operation: Operation, texts: Mapping[str, str]) -> str:
    name, operands, what = operation
    codes = [_name(code) for code in operands]
    if name == "number":
        return f"float({what[0]}{''.join(f'[{place}]' for place in what[1:])})"
    if name == "row":
        return f"{what[0]}.item({what[1]}, i)"
    if name == "call":
        return f"{what[0]}({', '.join(codes)})"
    return f"{codes[0]}[{what[0]}]" if name == "result" else texts[name].format(*codes)


def _name(code: int | str) -> str:
    return f"x{code}" if isinstance(code, int) else f"({code})"


def _quotient(a: float, b: float) -> float:
    try:
        return a / b
    except ZeroDivisionError:
        return float(np.float64(a) / b)


def _floor(x: float) -> float:
    return float(np.floor(x))
