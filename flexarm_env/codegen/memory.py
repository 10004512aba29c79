"""One piece of memory for all that a fleet's kernels work on.

Python hands its kernels one array, because each takes about 0.05 us of a call: a dozen took a tenth of a step.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flexarm_env.codegen.intrinsics import CACHE_LINE

WORD = 8  # [bytes]; of which all is counted


class ArraySpec(NamedTuple):
    """Where an array lies.

    Attributes:
        first: its first word.
        shape: of the array.
        dtype: of its numbers.
    """

    first: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    def view(self, memory: NDArray[np.float64]) -> NDArray[Any]:
        """The array itself, in a piece of memory."""
        return np.ndarray(self.shape, self.dtype, memory.data, WORD * self.first)


def aligned_zeros(words: int) -> NDArray[np.float64]:
    """Zeros that begin where a line of the processor's cache does: a vector across two lines costs a tenth more."""
    raw = np.zeros(WORD * words + CACHE_LINE, dtype=np.uint8)
    first = -raw.ctypes.data % CACHE_LINE
    return raw[first : first + WORD * words].view(np.float64)


def pack(arrays: Mapping[str, NDArray[Any]]) -> tuple[NDArray[np.float64], dict[str, ArraySpec]]:
    """One piece of memory with the contents of some arrays, one after the other, and where each lies."""
    parts, words = {}, 0
    for name, array in arrays.items():
        parts[name] = ArraySpec(words, array.shape, array.dtype)
        words += -(-array.nbytes // CACHE_LINE) * (CACHE_LINE // WORD)
    memory = aligned_zeros(words)
    for name, array in arrays.items():
        parts[name].view(memory)[:] = array
    return memory, parts
