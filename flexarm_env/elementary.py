"""Elementary functions of our own, the same bits in every kernel.

A library sine differs between scalar and vector code and between machines; these are sums and products only, so a
state is bit-identical in a single environment, in a batch of any size and on any thread. Written once, they run
on floats and numpy arrays, are recorded by `flexarm_env.tracing`, and are compiled as they stand.
"""

from __future__ import annotations

from typing import Any

from flexarm_env.tracing import floor


def sincos(x: Any) -> tuple[Any, Any]:
    """Sine and cosine, branch-free; within 2 units in the last place for |x| < 1e5 rad.

    pi/2 is subtracted in three parts (Cody & Waite 1980), the first two of 33 bits: k times them is exact for
    |k| < 2^20. Minimax polynomials on [-pi/4, pi/4] from the Cephes library (Moshier 1989), quadrant by
    arithmetic.

    Args:
        x: angle [rad].

    Returns:
        (sin x, cos x); both NaN where x is not finite.
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
    quarter = k - 4.0 * floor(k * 0.25)  # 0, 1, 2, 3
    half = floor(quarter * 0.5)  # 1 in the lower half plane
    swap = quarter - 2.0 * half  # 1 where sine and cosine change roles
    sine_sign = 1.0 - 2.0 * half
    cosine_sign = sine_sign * (1.0 - 2.0 * swap)
    keep = 1.0 - swap
    return sine_sign * (keep * s + swap * c), cosine_sign * (keep * c + swap * s)
