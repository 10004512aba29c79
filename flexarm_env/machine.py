"""What kernels ask of the processor and numba has no word for; written into their modules as intrinsics (`kernels`)."""

from __future__ import annotations

from typing import Any

from numba.core import types

CACHE_LINE = 64  # [bytes], and the widest vector


def fused(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    """a * b + c, rounded once: one instruction on every x86-64 processor since 2013 and on ARM64.

    Elsewhere it is a call into the C library, exact to the last bit as well, and slow.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), generate


def aligned_stack(typing_context: Any) -> Any:
    """Begin the stack frame of the function that calls this where a line of the processor's cache begins.

    Vectors that do not fit into registers are kept on the stack. LLVM settles its alignment before it knows of them,
    and where the callers happen to leave it unaligned each such vector lies across two lines: a step of a batch then
    takes a tenth longer.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.function.attributes.alignstack = CACHE_LINE
        builder.function.attributes.add("nounwind")  # true of all compiled code; without one more it is not written
        return context.get_dummy_value()

    return types.void(), generate


INTRINSICS = (fused, aligned_stack)
