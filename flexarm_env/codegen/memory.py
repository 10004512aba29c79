"""One piece of memory for all arrays of a batch's kernels.

Python passes one array to the kernels, because each argument of a call takes time.
"""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

WORD = 8  # [bytes]; the unit of all places
CACHE_LINE = 64  # [bytes], and the widest vector


class ArraySpec(NamedTuple):
    """Where an array lies.

    Attributes:
        first: its first word.
        shape: shape of the array.
        dtype: type of its numbers.
    """

    first: int
    shape: tuple[int, ...]
    dtype: np.dtype[Any]

    def view(self, memory: NDArray[np.float64]) -> NDArray[Any]:
        """Return the array itself, in a piece of memory."""
        return np.ndarray(self.shape, self.dtype, memory.data, WORD * self.first)


def machine_memory() -> float:
    """Return how much memory this machine has [bytes]; inf where the system does not say."""
    try:
        return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    except (AttributeError, ValueError, OSError):
        return math.inf


def aligned_zeros(words: int) -> NDArray[np.float64]:
    """Allocate zeros that begin where a line of the processor's cache does: vectors across two lines are slow."""
    raw = np.zeros(WORD * words + CACHE_LINE, dtype=np.uint8)
    first = -raw.ctypes.data % CACHE_LINE
    return raw[first : first + WORD * words].view(np.float64)


def pack(arrays: Mapping[str, NDArray[Any]]) -> tuple[NDArray[np.float64], dict[str, ArraySpec]]:
    """Copy some arrays into one piece of memory, one after the other; return it and where each lies."""
    parts, words = {}, 0
    for name, array in arrays.items():
        parts[name] = ArraySpec(words, array.shape, array.dtype)
        words += -(-array.nbytes // CACHE_LINE) * (CACHE_LINE // WORD)
    memory = aligned_zeros(words)
    for name, array in arrays.items():
        parts[name].view(memory)[:] = array
    return memory, parts
