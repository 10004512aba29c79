"""What kernels ask of the processor and numba has no word for; written into their modules as intrinsics (`kernels`)."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.np.arrayobj import populate_array

CACHE_LINE = 64  # [bytes], and the widest vector
TILE = 8  # lanes that are transposed at once


def fused(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """a * b + c, rounded once: one instruction on ARM64 and on x86-64 with FMA (Intel Core since 2013, AMD since 2012).

    Elsewhere it is a call into the C library, with the same bits, and slow.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """Emit it."""
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), generate


def aligned_stack(typing_context: Any) -> Any:
    """Begin the stack frame of the function that calls this where a line of the processor's cache begins.

    Vectors that do not fit into registers are kept on the stack. LLVM settles its alignment before it knows of them,
    and where the callers happen to leave it unaligned each such vector lies across two lines: a step of a batch then
    takes a tenth longer.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """Set the alignment on the function being built."""
        builder.function.attributes.alignstack = CACHE_LINE
        builder.function.attributes.add("nounwind")  # llvmlite writes the alignment only beside another
        return context.get_dummy_value()

    return types.void(), generate


def array_at(typing_context: Any, memory: Any, first: Any, shape: Any, dtype: Any) -> Any:
    """The array that begins at a word of a piece of memory, as ``array_at(memory, first, shape, dtype)``.

    Nothing is checked, counted or copied. A reshaped slice would take a call into numba's library, a view of another
    type two atomic operations, and each a tenth of a second to compile.
    """
    kind = types.Array(dtype.dtype, len(shape), "C")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """Fill in the array's structure."""
        whole = context.make_array(memory)(context, builder, arguments[0])
        array = context.make_array(kind)(context, builder)
        lengths = [builder.extract_value(arguments[2], n) for n in range(len(shape))]
        size = context.get_constant(types.intp, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
        strides = [size]
        for length in reversed(lengths[1:]):
            strides.insert(0, builder.mul(length, strides[0]))
        data = builder.bitcast(builder.gep(whole.data, [arguments[1]]), array.data.type)
        populate_array(array, data, lengths, strides, size, None)  # type: ignore[no-untyped-call]
        return array._getvalue()

    return kind(memory, first, shape, dtype), generate


def write_tile(typing_context: Any, rows: Any, distance: Any, places: Any, factors: Any, n: Any, lanes: Any) -> Any:
    """Transpose a tile of eight rows and eight lanes, as ``write_tile(rows, distance, places, factors, n, lanes)``.

    Lane i's numbers n to n + 7, side by side in ``lanes[i, n : n + 8]``, are ``rows[i + places[n] * distance] *
    factors[n]`` and so on, for the first eight lanes. A loop writes them one by one, which takes four times as long.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        """Eight loads, three rounds of exchanges between vectors, eight stores."""
        source, at, scale = (context.make_array(kind)(context, builder, arguments[k]) for k, kind in ((0, rows), (2, places), (3, factors)))
        wide, narrow = ir.VectorType(ir.DoubleType(), TILE), ir.VectorType(ir.FloatType(), TILE)
        vectors = []
        for k in range(TILE):
            number = builder.add(arguments[4], ir.Constant(ir.IntType(64), k))
            first = builder.mul(builder.load(builder.gep(at.data, [number])), arguments[1])
            vector = builder.load(builder.bitcast(builder.gep(source.data, [first]), wide.as_pointer()), align=8)
            factor = builder.insert_element(ir.Constant(wide, ir.Undefined), builder.load(builder.gep(scale.data, [number])), ir.Constant(ir.IntType(32), 0))
            every = builder.shuffle_vector(factor, factor, ir.Constant(ir.VectorType(ir.IntType(32), TILE), [0] * TILE))
            vectors.append(builder.fptrunc(builder.fmul(vector, every), narrow))
        for distance_ in (1, 2, 4):
            low = [k if not k & distance_ else k - distance_ + TILE for k in range(TILE)]
            high = [k + distance_ if not k & distance_ else k + TILE for k in range(TILE)]
            mixed = list(vectors)
            for k in range(TILE):
                if not k & distance_:
                    a, b = vectors[k], vectors[k + distance_]
                    mask = ir.VectorType(ir.IntType(32), TILE)
                    mixed[k] = builder.shuffle_vector(a, b, ir.Constant(mask, low))
                    mixed[k + distance_] = builder.shuffle_vector(a, b, ir.Constant(mask, high))
            vectors = mixed
        target = context.make_array(lanes)(context, builder, arguments[5])
        stride = builder.extract_value(target.strides, 0)
        begin = builder.bitcast(builder.gep(target.data, [arguments[4]]), ir.IntType(8).as_pointer())
        for k in range(TILE):
            row = builder.gep(begin, [builder.mul(stride, ir.Constant(ir.IntType(64), k))])
            builder.store(vectors[k], builder.bitcast(row, narrow.as_pointer()), align=4)
        return context.get_dummy_value()

    return types.void(rows, distance, places, factors, n, lanes), generate


INTRINSICS = (fused, aligned_stack, array_at, write_tile)
