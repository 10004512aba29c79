"""Writes a record as operations on vectors of lanes, which become LLVM's instructions without numba's or a loop's help.

numba takes long to read the text of a large kernel, and LLVM leaves a loop over lanes scalar if it reaches more than
some 250 rows of arrays whose addresses it must compare. A record holds arithmetic only, so each operation can be
written down for all lanes of a block at once. Each is rounded as the text would be (`tracing`).
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, NamedTuple

from llvmlite import ir

from flexarm_env.codegen.tracing import Expression, Trace

_ROW = re.compile(r"(\w+)\[i(?: \+ (\d+))?\]")


class Lowered(NamedTuple):
    """A kernel as `VectorWriter` takes it.

    Attributes:
        operations: template and operands; an operand is the number of an earlier operation, or a literal as a text. For
            an input: "row" with its array's place among the arguments and first number, or "number" with its place.
        stores: array, first number, and the operation, or literal, that goes there.
    """

    operations: list[tuple[Any, ...]]
    stores: list[tuple[int, int, int | str]]


def lowered(trace: Trace, stores: Sequence[tuple[str, Any]], arguments: Sequence[str]) -> Lowered:
    """Lower a record.

    Args:
        trace: the record; its inputs are rows of the arguments, ``array[i + 8]``, or numbers among them.
        stores: rows, and what is stored there.
        arguments: of the kernel.
    """
    numbers: dict[str, int] = {}
    operations: list[tuple[Any, ...]] = []
    for name, template, operands in trace.needed([value for _, value in stores if isinstance(value, Expression)]):
        numbers[name] = len(operations)
        if operands:
            operations.append((template, *(numbers.get(operand, operand) for operand in operands)))
        elif template in arguments:
            operations.append(("number", arguments.index(template)))
        else:
            operations.append(("row", *_row(template, arguments)))
    places = [
        (*_row(place, arguments), numbers[value.name] if isinstance(value, Expression) else repr(float(value)))
        for place, value in stores
    ]
    return Lowered(operations, places)


def _row(code: str, arguments: Sequence[str]) -> tuple[int, int]:
    """Place of an array among the arguments, and the first number of a row."""
    found = _ROW.fullmatch(code)
    assert found is not None, code
    return arguments.index(found[1]), int(found[2] or 0)


def kernel_text(
    trace: Trace, stores: Sequence[tuple[str, Any]], name: str, arguments: Sequence[str], lanes: int
) -> str:
    """Text of the intrinsic's code that a record becomes; its module has `VectorWriter` too.

    Args:
        trace: see `lowered`.
        stores: see `lowered`.
        name: of the kernel.
        arguments: of the kernel.
        lanes: of a block.
    """
    found, listed = lowered(trace, stores, arguments), ", ".join(arguments)
    return f"""\
def {name}(typing_context, {listed}):
    operations = {found.operations!r}
    stores = {found.stores!r}

    def generate(context, builder, signature, given):
        VectorWriter(context, builder, signature, given, {lanes}).write(operations, stores)
        return context.get_dummy_value()

    return types.void({listed}), generate
"""


class VectorWriter:
    """Emits a kernel for all lanes of a block; what it reads, it reads before it stores."""

    def __init__(self, context: Any, builder: Any, signature: Any, arguments: Any, lanes: int) -> None:
        """Begin one.

        Args:
            context: of numba's compiler.
            builder: of the function that calls the kernel.
            signature: types of the arguments.
            arguments: arrays and numbers.
            lanes: of a vector.
        """
        self.context, self.builder, self.lanes = context, builder, lanes
        self.types, self.arguments = signature.args, arguments
        self.kind = ir.VectorType(ir.DoubleType(), lanes)
        self.kept: dict[int, Any] = {}

    def write(self, operations: Any, stores: Any) -> None:
        """Emit all; see `Lowered`."""
        rules = self.rules()
        for place, (what, *codes) in enumerate(operations):
            if what == "row":
                self.kept[place] = self.builder.load(self.row(*codes), align=8)
            elif what == "number":
                self.kept[place] = self.spread(self.arguments[codes[0]])
            else:
                self.kept[place] = rules[what](*map(self.operand, codes))
        for array, first, code in stores:
            self.builder.store(self.operand(code), self.row(array, first), align=8)

    def rules(self) -> dict[str, Any]:
        """Return the function that writes each template of a record."""
        builder, less = self.builder, self.less
        return {
            "{0} + {1}": builder.fadd,
            "{0} - {1}": builder.fsub,
            "{0} * {1}": builder.fmul,
            "{0} / {1}": builder.fdiv,
            "-{0}": builder.fneg,
            "fused({0}, {1}, {2})": lambda a, b, c: self.library("fma", a, b, c),
            "fused(-{0}, {1}, {2})": lambda a, b, c: self.library("fma", builder.fneg(a), b, c),
            "fused({0}, {1}, -{2})": lambda a, b, c: self.library("fma", a, b, builder.fneg(c)),
            "floor({0})": lambda a: self.library("floor", a),
            "sqrt({0})": lambda a: self.library("sqrt", a),
            "abs({0})": lambda a: self.library("fabs", a),
            "({2} if {0} < {1} else {3})": less,
            "({1} if {0} < {1} else ({2} if {0} > {2} else {0}))": lambda a, b, c: less(a, b, b, less(c, a, c, a)),
            "({1} if {0} < {1} else {0})": lambda a, b: less(a, b, b, a),
            "quarter_turns({0}, {1}, {2})": self.quarter_turns,
            "{0}[0]": lambda pair: pair[0],
            "{0}[1]": lambda pair: pair[1],
        }

    def row(self, array: int, first: int) -> Any:
        """Where a row of an array lies."""
        data = self.context.make_array(self.types[array])(self.context, self.builder, self.arguments[array]).data
        return self.builder.bitcast(
            self.builder.gep(data, [ir.Constant(ir.IntType(64), first)]), self.kind.as_pointer()
        )

    def spread(self, value: Any) -> Any:
        """Copy a number into every lane."""
        short, undefined = ir.IntType(32), ir.Constant(self.kind, ir.Undefined)
        first = self.builder.insert_element(undefined, value, ir.Constant(short, 0))
        places = ir.Constant(ir.VectorType(short, self.lanes), [0] * self.lanes)
        return self.builder.shuffle_vector(first, undefined, places)

    def operand(self, code: Any) -> Any:
        """Return an earlier result, or a literal in every lane."""
        return self.kept[code] if isinstance(code, int) else ir.Constant(self.kind, [float(code)] * self.lanes)

    def library(self, name: str, *values: Any) -> Any:
        """One of LLVM's own functions."""
        full = f"llvm.{name}.v{self.lanes}f64"
        declared = self.builder.module.globals.get(full)
        if declared is None:
            declared = ir.Function(self.builder.module, ir.FunctionType(self.kind, [self.kind] * len(values)), full)
        return self.builder.call(declared, values)

    def less(self, a: Any, b: Any, then: Any, otherwise: Any) -> Any:
        """Choose by a < b in each lane."""
        return self.builder.select(self.builder.fcmp_ordered("<", a, b), then, otherwise)

    def quarter_turns(self, k: Any, sine: Any, cosine: Any) -> list[Any]:
        """As `intrinsics.quarter_turns`, by the last two bits of k."""
        builder, whole = self.builder, ir.VectorType(ir.IntType(64), self.lanes)
        one, two, to_sign = (ir.Constant(whole, [value] * self.lanes) for value in (1, 2, 62))
        turns = builder.bitcast(builder.fadd(k, self.operand("6755399441055744.0")), whole)
        odd = builder.icmp_unsigned("!=", builder.and_(turns, one), ir.Constant(whole, [0] * self.lanes))
        pair = []
        for then, otherwise, count in ((cosine, sine, turns), (sine, cosine, builder.add(turns, one))):
            value = builder.bitcast(builder.select(odd, then, otherwise), whole)
            sign = builder.shl(builder.and_(count, two), to_sign)
            pair.append(builder.bitcast(builder.xor(value, sign), self.kind))
        return pair
