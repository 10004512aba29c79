"""Alignment of a compiled function's stack: written into kernel modules as a numba intrinsic (`kernels`)."""

from __future__ import annotations

from typing import Any

from numba.core import types

CACHE_LINE = 64  # [bytes], and the widest vector


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
