"""`flexarm_env.codegen.tracing`'s functions for single numbers; the kernels' scalar code is compiled with them."""

from __future__ import annotations

from math import isfinite, nan, sqrt


def root(x: float) -> float:
    """Return the square root."""
    return sqrt(x)


def magnitude(x: float) -> float:
    """Return the absolute value."""
    return abs(x)


def where_less(x: float, bound: float, then: float, otherwise: float) -> float:
    """Return `then` where x < bound, else `otherwise`."""
    return then if x < bound else otherwise


def clip(x: float, low: float, high: float) -> float:
    """Return x limited to [low, high]; NaN stays NaN."""
    return low if x < low else (high if x > high else x)


def at_least(x: float, low: float) -> float:
    """Return the larger of x and low; NaN stays NaN."""
    return low if x < low else x


def quarter_turns(k: float, sine: float, cosine: float) -> tuple[float, float]:
    """Return the sine and cosine of an angle k quarter turns on."""
    if not isfinite(k):
        return nan, nan
    return ((sine, cosine), (cosine, -sine), (-sine, -cosine), (-cosine, sine))[int(k % 4.0)]
