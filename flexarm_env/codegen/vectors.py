"""Writes a record as operations on vectors of lanes, which become LLVM's instructions without numba's or a loop's help.

numba takes long to read the text of a large kernel, and LLVM leaves a loop over lanes scalar if it reaches more than
some 250 rows of arrays whose addresses it must compare. A record holds arithmetic only, so each operation can be
written down for several lanes at once. Each is rounded as the text would be (`tracing`), in a vector and in one lane.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from llvmlite import ir
from numba.core import types

from flexarm_env.codegen.intrinsics import CACHE_LINE
from flexarm_env.codegen.tracing import Expression, Trace

_ROW = re.compile(r"(\w+)\[i(?: \+ (\d+))?\]")
_NUMBER = re.compile(r"(\w+)((?:\[\d+\])*)")


class Lowered(NamedTuple):
    """A kernel, or a function that kernels call, as `VectorWriter` takes it.

    Attributes:
        operations: template and operands; an operand is the number of an earlier operation, or a literal as a text. For
            an input: "row" with its array's place among the arguments and first number, or "number" with its place and
            the places of a tuple's or an array's element.
        results: what a function gives, or a kernel stores: the operation, or literal, of each.
        places: where a kernel stores each: array and first number; none of a function.
    """

    operations: list[tuple[Any, ...]]
    results: list[int | str]
    places: list[tuple[int, int]]


def lowered(
    trace: Trace, results: Sequence[Any], arguments: Sequence[str], places: Sequence[str] = (), fusing: bool = True
) -> Lowered:
    """Lower a record.

    Args:
        trace: the record; its inputs are rows of the arguments, ``array[i + 8]``, or numbers among them.
        results: what it finds.
        arguments: of the kernel or function.
        places: rows where a kernel stores the results.
        fusing: sums with products.
    """
    numbers: dict[str, int] = {}
    operations: list[tuple[Any, ...]] = []
    for name, template, operands in trace.needed(results, fusing):
        numbers[name] = len(operations)
        if operands:
            operations.append((template, *(numbers.get(operand, operand) for operand in operands)))
        else:
            operations.append(_input(template, arguments))
    codes = [numbers[value.name] if isinstance(value, Expression) else repr(float(value)) for value in results]
    return Lowered(operations, codes, [_input(place, arguments)[1:] for place in places])


def _input(code: str, arguments: Sequence[str]) -> tuple[Any, ...]:
    """Find an input: a row of an array among the arguments, or a number."""
    row = _ROW.fullmatch(code)
    if row is not None:
        return "row", arguments.index(row[1]), int(row[2] or 0)
    number = _NUMBER.fullmatch(code)
    assert number is not None, code
    return "number", arguments.index(number[1]), *map(int, re.findall(r"\d+", number[2]))


def kernel_text(
    name: str, arguments: Sequence[str], lanes: int, kernel: Lowered, functions: Mapping[str, Lowered]
) -> str:
    """Write the text of the intrinsic's code that a record becomes; its module has `VectorWriter` too.

    Args:
        name: of the kernel.
        arguments: of the kernel.
        lanes: of a block.
        kernel: its record.
        functions: that it calls.
    """
    listed, called = ", ".join(arguments), {name: tuple(function) for name, function in functions.items()}
    return f"""\
def {name}(typing_context, {listed}):
    kernel = {tuple(kernel)!r}
    functions = {called!r}

    def generate(context, builder, signature, given):
        writer = VectorWriter(context, builder, {lanes}, functions)
        writer.call_kernel({name!r}, kernel, signature.args, given, {CACHE_LINE})
        return context.get_dummy_value()

    return types.void({listed}), generate
"""


class VectorWriter:
    """Emits a kernel for all lanes of a block; of some lanes at a time it reads all before it stores anything.

    Attributes:
        kind: of the numbers of some lanes.
        width: how many lanes.
    """

    def __init__(self, context: Any, builder: Any, lanes: int, functions: Any) -> None:
        """Begin one.

        Args:
            context: of numba's compiler.
            builder: of the function that calls the kernel.
            lanes: of a block.
            functions: that the kernel may call (`Lowered`), by name.
        """
        self.context, self.builder, self.lanes, self.functions = context, builder, lanes, functions
        _, _, features = context.codegen().magic_tuple()
        self.width = 8 if "+avx512f" in features else 4
        while lanes % self.width != 0:
            self.width //= 2
        double, whole = ir.DoubleType(), ir.IntType(64)
        self.kind = ir.VectorType(double, self.width) if self.width > 1 else double
        self.whole = ir.VectorType(whole, self.width) if self.width > 1 else whole
        self.first_lane: Any = None

    # --- functions ----------------------------------------------------------------------------------------------------

    def call_kernel(self, name: str, kernel: Any, kinds: Any, given: Any, alignment: int) -> None:
        """Write the kernel as a function of the module, once, and call it.

        Args:
            name: of the kernel.
            kernel: see `Lowered`.
            kinds: types of the arguments.
            given: the arguments, arrays and numbers.
            alignment: of the stack, where vectors lie that do not fit into registers: none lies across two lines.
        """
        caller = self.builder
        parts = [self.parts(kind, value) for kind, value in zip(kinds, given, strict=True)]
        function = caller.module.globals.get(name)
        if function is None:
            flat = self.flat(parts)
            function = ir.Function(caller.module, ir.FunctionType(ir.VoidType(), [part.type for part in flat]), name)
            function.linkage = "internal"
            function.attributes.alignstack = alignment
            function.attributes.add("nounwind")
            function.attributes.add("noinline")
            self.builder = ir.IRBuilder(function.append_basic_block())
            self.write_kernel(kernel, self.nested(parts, iter(function.args)))
            self.builder = caller
        caller.call(function, self.flat(parts))

    def parts(self, kind: Any, value: Any) -> Any:
        """Return the data of an array, a number as a double, or those of a tuple."""
        if isinstance(kind, types.Array):
            return self.context.make_array(kind)(self.context, self.builder, value).data
        if isinstance(kind, types.BaseTuple):
            tuple_kinds: Any = kind
            return [self.parts(part, self.builder.extract_value(value, n)) for n, part in enumerate(tuple_kinds)]
        return self.context.cast(self.builder, value, kind, types.float64)

    def flat(self, parts: Any) -> list[Any]:
        """Return all within nested lists."""
        return [one for part in parts for one in (self.flat(part) if isinstance(part, list) else [part])]

    def nested(self, parts: Any, flat: Any) -> list[Any]:
        """Invert `flat`: nest as `parts` is."""
        return [self.nested(part, flat) if isinstance(part, list) else next(flat) for part in parts]

    def write_kernel(self, kernel: Any, arguments: Any) -> None:
        """Emit a kernel's body: what it reads of all lanes, then a loop over as many lanes as go together."""
        operations, results, places = kernel
        builder, count = self.builder, self.lanes // self.width
        known = {
            place: self.number(arguments[first], further)
            for place, (what, first, *further) in enumerate(operations)
            if what == "number"
        }
        if count > 1:
            entry, body, after = builder.block, builder.append_basic_block(), builder.append_basic_block()
            builder.branch(body)
            builder.position_at_end(body)
            self.first_lane = builder.phi(ir.IntType(64))
            self.first_lane.add_incoming(ir.Constant(ir.IntType(64), 0), entry)
        values = self.evaluate(operations, known, arguments)
        found = [self.operand(values, code) for code in results]
        for (array, first), value in zip(places, found, strict=True):
            builder.store(value, self.row(arguments[array], first), align=8)
        if count > 1:
            following = builder.add(self.first_lane, ir.Constant(ir.IntType(64), self.width))
            self.first_lane.add_incoming(following, body)
            builder.cbranch(builder.icmp_unsigned("<", following, ir.Constant(ir.IntType(64), self.lanes)), body, after)
            builder.position_at_end(after)
        builder.ret_void()

    def called(self, name: str, given: Any) -> list[Any]:
        """Emit what a function that kernels call does.

        It loads the rows among its arguments itself, anew: a row that stayed in a register from one call to the next
        would have to be stored on the stack in between, since there are far more rows than registers.
        """
        operations, results, _ = self.functions[name]
        if any(isinstance(argument, tuple) for argument in given):
            self.builder.asm(ir.FunctionType(ir.VoidType(), []), "", "~{memory}", (), True)  # what was loaded is stale
        known = {place: given[what[1]] for place, what in enumerate(operations) if what[0] == "number"}
        values = self.evaluate(operations, known, ())
        return [self.operand(values, code) for code in results]

    # --- operations ---------------------------------------------------------------------------------------------------

    def evaluate(self, operations: Any, known: Any, arguments: Any) -> dict[int, Any]:
        """Emit all operations; see `Lowered`. `known`: the values of numbers.

        A row's value is its array and first number until an operation needs it, which then loads it (`operand`).
        """
        values, rules = dict(known), self.rules()
        for place, (what, *codes) in enumerate(operations):
            if what == "row":
                values[place] = arguments[codes[0]], codes[1]
            elif what in rules:
                values[place] = rules[what](*[self.operand(values, code) for code in codes])
            elif what.startswith("{0}["):  # one of several results
                values[place] = values[codes[0]][int(what[4:-1])]
            elif what != "number":
                given = [values[code] if isinstance(code, int) else self.operand(values, code) for code in codes]
                values[place] = self.called(what[: what.index("(")], given)
        return values

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
        }

    def number(self, argument: Any, places: Any) -> Any:
        """Copy a number that all lanes share, an argument or an element of one, into every lane."""
        for place in places:
            if isinstance(argument, list):
                argument = argument[place]
            else:
                argument = self.builder.load(self.builder.gep(argument, [ir.Constant(ir.IntType(64), place)]))
        return self.spread(argument)

    def row(self, data: Any, first: int) -> Any:
        """Return where the present lanes' numbers of a row lie."""
        place = ir.Constant(ir.IntType(64), first)
        if self.first_lane is not None:
            place = self.builder.add(self.first_lane, place)
        pointer = self.builder.gep(data, [place])
        return self.builder.bitcast(pointer, self.kind.as_pointer())

    def spread(self, value: Any) -> Any:
        """Copy a number into every lane."""
        if self.width == 1:
            return value
        short, undefined = ir.IntType(32), ir.Constant(self.kind, ir.Undefined)
        first = self.builder.insert_element(undefined, value, ir.Constant(short, 0))
        places = ir.Constant(ir.VectorType(short, self.width), [0] * self.width)
        return self.builder.shuffle_vector(first, undefined, places)

    def constant(self, kind: Any, value: Any) -> Any:
        """Return a literal in every lane."""
        return ir.Constant(kind, [value] * self.width if self.width > 1 else value)

    def operand(self, values: Any, code: Any) -> Any:
        """Return an earlier result, a row that is loaded now, or a literal in every lane."""
        if not isinstance(code, int):
            return self.constant(self.kind, float(code))
        if isinstance(values[code], tuple):
            values[code] = self.builder.load(self.row(*values[code]), align=8)
        return values[code]

    def library(self, name: str, *values: Any) -> Any:
        """One of LLVM's own functions."""
        full = f"llvm.{name}.v{self.width}f64" if self.width > 1 else f"llvm.{name}.f64"
        declared = self.builder.module.globals.get(full)
        if declared is None:
            declared = ir.Function(self.builder.module, ir.FunctionType(self.kind, [self.kind] * len(values)), full)
        return self.builder.call(declared, values)

    def less(self, a: Any, b: Any, then: Any, otherwise: Any) -> Any:
        """Choose by a < b in each lane."""
        return self.builder.select(self.builder.fcmp_ordered("<", a, b), then, otherwise)

    def quarter_turns(self, k: Any, sine: Any, cosine: Any) -> list[Any]:
        """As `intrinsics.quarter_turns`, by the last two bits of k."""
        builder = self.builder
        one, two, to_sign = (self.constant(self.whole, value) for value in (1, 2, 62))
        turns = builder.bitcast(builder.fadd(k, self.constant(self.kind, 6755399441055744.0)), self.whole)
        odd = builder.icmp_unsigned("!=", builder.and_(turns, one), self.constant(self.whole, 0))
        turned = []
        for then, otherwise, count in ((cosine, sine, turns), (sine, cosine, builder.add(turns, one))):
            value = builder.bitcast(builder.select(odd, then, otherwise), self.whole)
            sign = builder.shl(builder.and_(count, two), to_sign)
            turned.append(builder.bitcast(builder.xor(value, sign), self.kind))
        return turned
