"""Intrinsics: instructions of the processor that numba cannot express, with their meaning in plain Python."""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.np.arrayobj import populate_array
from numpy.typing import NDArray

from flexarm_env.codegen import tracing
from flexarm_env.codegen.arrays import LaneRows, Memory, Observations, Table, Words
from flexarm_env.codegen.declarations import intrinsic
from flexarm_env.codegen.vectors import VectorWriter

TILE = 8  # lanes that are transposed at once


def _quarter_turns(typing_context: Any, k: Any, sine: Any, cosine: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """Generate the instructions that choose and sign sine and cosine."""
        turned = VectorWriter(context, builder, 1, {}).quarter_turns(*arguments)
        return context.make_tuple(builder, signature.return_type, turned)

    pair = types.UniTuple(types.float64, 2)
    return pair(types.float64, types.float64, types.float64), generate


@intrinsic(_quarter_turns)
def quarter_turns(k: float, sine: float, cosine: float) -> tuple[float, float]:
    """Return the sine and cosine of an angle k quarter turns on (`tracing.quarter_turns`), by the last two bits of k.

    Choices and signs are made by integer operations, which leave the floating-point units free. The result is bitwise
    identical for |k| < 2^51.
    """
    return tracing.quarter_turns(k, sine, cosine)


def _array_at(typing_context: Any, memory: Any, first: Any, shape: Any, dtype: Any) -> Any:
    kind = types.Array(dtype.dtype, len(shape), "C")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """Generate the instructions that make an array of a piece of memory."""
        whole = context.make_array(memory)(context, builder, arguments[0])
        array = context.make_array(kind)(context, builder)
        lengths = [builder.extract_value(arguments[2], n) for n in range(len(shape))]
        size = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
        strides = [size]
        for length in reversed(lengths[1:]):
            strides.insert(0, builder.mul(length, strides[0]))
        data = builder.bitcast(builder.gep(whole.data, [arguments[1]]), array.data.type)
        populate_array(array, data, lengths, strides, size, None)
        return array._getvalue()

    return kind(memory, first, shape, dtype), generate


@intrinsic(_array_at)
def array_at(memory: Memory, first: int, shape: tuple[int, ...], dtype: type[Any]) -> NDArray[Any]:
    """Return the array that begins at a word of a piece of memory.

    Nothing is checked, counted or copied. A reshaped slice would call numba's library, and a view of another type would
    take two atomic operations; both take longer to compile.
    """
    return np.ndarray(shape, dtype, memory.data, memory.itemsize * first)


def _write_tile(typing_context: Any, rows: Any, distance: Any, places: Any, factors: Any, n: Any, lanes: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """Generate the instructions that write a tile."""
        inputs = context.make_helper(builder, signature.args[0], arguments[0])
        where, scales, output = (
            context.make_array(signature.args[k])(context, builder, arguments[k]) for k in (2, 3, 5)
        )
        doubles, floats = (ir.VectorType(kind, TILE) for kind in (ir.DoubleType(), ir.FloatType()))
        indices = ir.VectorType(ir.IntType(32), TILE)
        undefined = ir.Constant(doubles, ir.Undefined)
        vectors = []
        for k in range(TILE):
            place = builder.add(arguments[4], ir.Constant(arguments[4].type, k))
            first = builder.mul(builder.load(builder.gep(where.data, [place])), arguments[1])
            values = builder.load(builder.bitcast(builder.gep(inputs.data, [first]), doubles.as_pointer()), align=8)
            factor = builder.load(builder.gep(scales.data, [place]))
            factor = builder.insert_element(undefined, factor, ir.Constant(ir.IntType(32), 0))
            factor = builder.shuffle_vector(factor, undefined, ir.Constant(indices, [0] * TILE))
            vectors.append(builder.fptrunc(builder.fmul(values, factor), floats))
        for half in (1, 2, 4):  # vector k and its partner exchange the numbers whose place has, or lacks, this bit
            for k in range(TILE):
                if k & half == 0:
                    pair = vectors[k], vectors[k + half]
                    kept = [n if n & half == 0 else n - half + TILE for n in range(TILE)]
                    given = [n + half for n in kept]
                    vectors[k] = builder.shuffle_vector(*pair, ir.Constant(indices, kept))
                    vectors[k + half] = builder.shuffle_vector(*pair, ir.Constant(indices, given))
        row = builder.bitcast(builder.gep(output.data, [arguments[4]]), ir.IntType(8).as_pointer())
        for vector in vectors:
            builder.store(vector, builder.bitcast(row, floats.as_pointer()), align=4)
            row = builder.gep(row, [builder.extract_value(output.strides, 0)])
        return context.get_dummy_value()

    return types.void(rows, distance, places, factors, n, lanes), generate


@intrinsic(_write_tile)
def write_tile(rows: LaneRows, distance: int, places: Words, factors: Table, n: int, lanes: Observations) -> None:
    """Write eight numbers of each of eight lanes: ``lanes[i, k] = rows[places[k], i] * factors[k]``.

    Here i is 0 to 7 and k is n to n + 7; nothing is checked. `distance` is how many numbers a row of the block has.
    Since a lane's observation lies side by side, a loop could only write numbers one by one; here they change places
    within vectors first.
    """
    for k in range(n, n + TILE):
        lanes[:TILE, k] = rows[places[k], :TILE] * factors[k]
