"""Writes a record as operations on vectors of lanes, which become LLVM's instructions without numba's or a loop's help.

numba takes long to read the text of a large kernel, and LLVM leaves a loop over lanes scalar if it reaches more than
some 250 rows of arrays whose addresses it must compare. A record holds arithmetic only, so each operation can be
written down for several lanes at once. Each is rounded as the text would be (`tracing`), in a vector and in one lane.
"""

from __future__ import annotations

from collections.abc import Mapping
from inspect import Parameter, Signature
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from flexarm_env.codegen.memory import CACHE_LINE
from flexarm_env.codegen.rows import Rows
from flexarm_env.codegen.tracing import Recording


def vector_kernel(name: str, lanes: int, recording: Recording) -> Any:
    """Return what numba takes for a recorded kernel.

    Args:
        name: of the kernel.
        lanes: of a block.
        recording: of the kernel.
    """

    def typed(typing_context: Any, *kinds: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, given: Any) -> Any:
            VectorWriter(context, builder, lanes, recording.functions).call_kernel(name, recording, kinds, given)
            return context.get_dummy_value()

        return types.void(*kinds), generate

    names = ("typing_context", *recording.parameters)
    typed.__signature__ = Signature([Parameter(name, Parameter.POSITIONAL_OR_KEYWORD) for name in names])  # type: ignore[attr-defined]
    return intrinsic(typed)


class VectorWriter:
    """Emits a kernel for all lanes of a block; of some lanes at a time it reads all before it stores anything.

    Attributes:
        kind: of the numbers of some lanes.
        width: how many lanes.
    """

    def __init__(self, context: Any, builder: Any, lanes: int, functions: Mapping[str, Recording]) -> None:
        """Begin one.

        Args:
            context: of numba's compiler.
            builder: of the function that calls the kernel.
            lanes: of a block.
            functions: that the kernel may call, by name.
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

    def call_kernel(self, name: str, kernel: Recording, kinds: Any, given: Any) -> None:
        """Write the kernel as a function of the module, once, and call it.

        The stack is aligned: no vector that does not fit into the registers lies across two lines of the cache.

        Args:
            name: of the kernel.
            kernel: its recording.
            kinds: types of the arguments.
            given: the arguments, arrays and numbers.
        """
        caller = self.builder
        parts = [self.parts(kind, value) for kind, value in zip(kinds, given, strict=True)]
        function = caller.module.globals.get(name)
        if function is None:
            flat = self.flat(parts)
            function = ir.Function(caller.module, ir.FunctionType(ir.VoidType(), [part.type for part in flat]), name)
            function.linkage = "internal"
            function.attributes.alignstack = CACHE_LINE
            function.attributes.add("nounwind")
            function.attributes.add("noinline")
            self.builder = ir.IRBuilder(function.append_basic_block())
            arguments = self.nested(parts, iter(function.args))
            self.write_kernel(kernel, dict(zip(kernel.parameters, arguments, strict=True)))
            self.builder = caller
        caller.call(function, self.flat(parts))

    def parts(self, kind: Any, value: Any) -> Any:
        """Return the data of rows or an array, a number as a double, or those of a tuple."""
        if isinstance(kind, Rows):
            return self.context.make_helper(self.builder, kind, value).data
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

    def write_kernel(self, kernel: Recording, arguments: Mapping[str, Any]) -> None:
        """Emit a kernel's body: what it reads of all lanes, then a loop over as many lanes as go together."""
        builder, count = self.builder, self.lanes // self.width
        known = {
            index: self.number(arguments[operation.what[0]], operation.what[1:])
            for index, operation in enumerate(kernel.operations)
            if operation.name == "number"
        }
        if count > 1:
            entry, body, after = builder.block, builder.append_basic_block(), builder.append_basic_block()
            builder.branch(body)
            builder.position_at_end(body)
            self.first_lane = builder.phi(ir.IntType(64))
            self.first_lane.add_incoming(ir.Constant(ir.IntType(64), 0), entry)
        values = self.evaluate(kernel, known, arguments)
        found = [self.operand(values, code) for code in kernel.results]
        for (array, first), value in zip(kernel.places, found, strict=True):
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
        if any(isinstance(argument, tuple) for argument in given):
            self.builder.asm(ir.FunctionType(ir.VoidType(), []), "", "~{memory}", (), True)  # what was loaded is stale
        function = self.functions[name]
        arguments = dict(zip(function.parameters, given, strict=True))
        known = {index: arguments[one.what[0]] for index, one in enumerate(function.operations) if one.name == "number"}
        values = self.evaluate(function, known, {})
        return [self.operand(values, code) for code in function.results]

    # --- operations ---------------------------------------------------------------------------------------------------

    def evaluate(self, recording: Recording, known: Mapping[int, Any], arguments: Mapping[str, Any]) -> dict[int, Any]:
        """Emit all operations of a recording. `known`: the values of numbers.

        A row's value is its array and the row until an operation needs it, which then loads it (`operand`).
        """
        values, rules = dict(known), self.rules()
        for index, (name, operands, what) in enumerate(recording.operations):
            if name == "row":
                values[index] = arguments[what[0]], what[1]
            elif name == "result":
                values[index] = self.operand(values, operands[0])[what[0]]
            elif name == "call" and what[0] != "quarter_turns":
                given = [values[code] if isinstance(code, int) else self.operand(values, code) for code in operands]
                values[index] = self.called(what[0], given)
            elif name != "number":
                rule = self.quarter_turns if name == "call" else rules[name]
                values[index] = rule(*[self.operand(values, code) for code in operands])
        return values

    def rules(self) -> dict[str, Any]:
        """Return the function that writes each operation of a record."""
        builder, less = self.builder, self.less
        return {
            "add": builder.fadd,
            "subtract": builder.fsub,
            "multiply": builder.fmul,
            "divide": builder.fdiv,
            "negate": builder.fneg,
            "multiply_add": lambda a, b, c: self.library("fma", a, b, c),
            "multiply_subtract_from": lambda a, b, c: self.library("fma", builder.fneg(a), b, c),
            "multiply_subtract": lambda a, b, c: self.library("fma", a, b, builder.fneg(c)),
            "floor": lambda a: self.library("floor", a),
            "root": lambda a: self.library("sqrt", a),
            "magnitude": lambda a: self.library("fabs", a),
            "where_less": less,
            "clip": lambda a, b, c: less(a, b, b, less(c, a, c, a)),
            "at_least": lambda a, b: less(a, b, b, a),
        }

    def number(self, argument: Any, places: Any) -> Any:
        """Copy a number that all lanes share, an argument or an element of one, into every lane."""
        for place in places:
            if isinstance(argument, list):
                argument = argument[place]
            else:
                argument = self.builder.load(self.builder.gep(argument, [ir.Constant(ir.IntType(64), place)]))
        return self.spread(argument)

    def row(self, data: Any, row: int) -> Any:
        """Return where the present lanes' numbers of a row lie."""
        place = ir.Constant(ir.IntType(64), row * self.lanes)
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
        """Emit `tracing.quarter_turns`, by the last two bits of k.

        Adding 1.5 * 2^52 moves a whole number to the last bits of its sum; a sign is the first bit.
        """
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
