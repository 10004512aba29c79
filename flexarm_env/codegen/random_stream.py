"""A counter-based random stream: the number at a place depends on the key and the place alone.

An episode's key is drawn from the environment's `np_random` at its reset; everything random after that comes from
here, in the kernel, so that an episode is the same alone, in a batch, and with any neighbours.
Compiled into the kernels as it stands (`compiler`).
"""

from __future__ import annotations

from math import log, sqrt
from typing import Any

import numpy as np

from flexarm_env.codegen.elementary import sincos

STRIDE = 0x9E3779B97F4A7C15  # 2^64 over the golden ratio


def mixed_bits(bits: Any) -> Any:
    """Apply the finaliser of SplitMix64 (Steele, Lea & Flood 2014), a bijection of 64 bits."""
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return bits ^ (bits >> np.uint64(31))


def uniform(key: Any, place: int) -> float:
    """Draw a number in [0, 1), in steps of 2^-53."""
    bits = mixed_bits(key ^ mixed_bits(np.uint64(place + 1) * np.uint64(STRIDE)))
    return (bits >> np.uint64(11)) * 2.0**-53


def normal(key: Any, place: int) -> float:
    """Draw a standard normal deviate of magnitude below 8.6; it uses `place` and the next number."""
    return normal_pair(key, place)[0]


def normal_pair(key: Any, place: int) -> tuple[float, float]:
    """Two independent standard normal deviates (Box & Muller 1958); uses up `place` and the next."""
    radius = sqrt(-2.0 * log(1.0 - uniform(key, place)))
    sine, cosine = sincos(6.283185307179586 * uniform(key, place + 1))
    return radius * cosine, radius * sine
