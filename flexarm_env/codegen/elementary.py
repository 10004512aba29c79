"""Elementary functions whose results are bitwise identical in scalar and vector code.

A library sine differs between scalar and vector code and between machines; these are sums and products only, so a
state is bitwise identical in a single environment, in a batch of any size and on any thread. Written once, they run
on floats and numpy arrays, are recorded by `tracing` (which fuses sums and products) for all kernels of a module, and
are compiled as they stand.

At the end a counter-based random stream: the number at a place depends on the key and the place alone. An episode's
key is drawn from the environment's `np_random` at its reset; everything random after that comes from here, in the
kernel, so that an episode is the same alone, in a batch, and with any neighbours.
"""

from __future__ import annotations

from math import log, sqrt
from typing import Any

import numpy as np

from flexarm_env.codegen.tracing import at_least, clip, floor, magnitude, quarter_turns, recorded_once, where_less


@recorded_once(2)
def sincos(x: Any) -> tuple[Any, Any]:
    """Return sine and cosine of an angle [rad], branch-free; within 2 units in the last place for |x| < 1e5 rad.

    pi/2 is subtracted in three parts (Cody & Waite 1980), the first two of 33 bits: k times them is exact for
    |k| < 2^20. Minimax polynomials on [-pi/4, pi/4] from the Cephes library (Moshier 1989). Both are NaN where x is not
    finite.
    """
    k = floor(x * 0.636619772367581343076 + 0.5)
    r = x - k * 1.57079632673412561417e00
    r = r - k * 6.07710050630396597660e-11
    r = r - k * 2.02226624879595063154e-21
    z = r * r
    p = 1.58962301576546568060e-10 * z - 2.50507477628578072866e-8
    p = p * z + 2.75573136213857245213e-6
    p = p * z - 1.98412698295895385996e-4
    p = p * z + 8.33333333332211858878e-3
    p = p * z - 1.66666666666666307295e-1
    s = p * z * r + r
    p = -1.13585365213876817300e-11 * z + 2.08757008419747316778e-9
    p = p * z - 2.75573141792967388112e-7
    p = p * z + 2.48015872888517045348e-5
    p = p * z - 1.38888888888730564116e-3
    p = p * z + 4.16666666666665929218e-2
    c = p * z * z - 0.5 * z + 1.0
    return quarter_turns(k, s, c)


@recorded_once(1)
def exp_minus(x: Any) -> Any:
    """Return exp(-x) for x >= 0, relative error below 1e-12; 0 to within 1e-300 beyond x = 700.

    The Taylor polynomial of exp(-x / 1024), squared ten times.
    """
    r = clip(x, 0.0, 700.0) * (-1.0 / 1024.0)
    p = 1.0 + r * (1.0 / 16.0)
    for n in range(15, 0, -1):
        p = 1.0 + r * (1.0 / n) * p
    for _ in range(10):
        p = p * p
    return p


@recorded_once(1)
def arctan2(y: Any, x: Any) -> Any:
    """Return the angle of the point (x, y) in [-pi, pi], branch-free; within 4 units in the last place.

    The smaller coordinate over the larger, reduced to [-tan(pi/8), tan(pi/8)], and the rational approximation of the
    Cephes library (Moshier 1989). At the origin 0; NaN where a coordinate is NaN.
    """
    across, along = magnitude(y), magnitude(x)
    low = where_less(across, along, across, along)
    high = where_less(across, along, along, across)
    t = low / at_least(high, 1e-300)
    wide = where_less(t, 0.41421356237309503, 0.0, 1.0)
    t = (t - wide) / (1.0 + wide * t)
    z = t * t
    p = -8.750608600031904122785e-1 * z - 1.615753718733365076637e1
    p = p * z - 7.500855792314704667340e1
    p = p * z - 1.228866684490136173410e2
    p = p * z - 6.485021904942025371773e1
    q = z + 2.485846490142306297962e1
    q = q * z + 1.650270098316988542046e2
    q = q * z + 4.328810604912902668951e2
    q = q * z + 4.853903996359136964868e2
    q = q * z + 1.945506571482613964425e2
    angle = wide * 0.78539816339744830962 + (t + t * (z * p / q))
    angle = where_less(along, across, 1.57079632679489661923 - angle, angle)
    angle = where_less(x, 0.0, 3.14159265358979323846 - angle, angle)
    return where_less(y, 0.0, -angle, angle)


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
    """Draw two independent standard normal deviates (Box & Muller 1958), from `place` and the next."""
    radius = sqrt(-2.0 * log(1.0 - uniform(key, place)))
    sine, cosine = sincos(6.283185307179586 * uniform(key, place + 1))
    return radius * cosine, radius * sine
