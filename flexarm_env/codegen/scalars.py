"""`flexarm_env.codegen.tracing`'s functions for single numbers: what the kernels' scalar code is compiled with."""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt
from typing import Any

import numpy as np

from flexarm_env.codegen import intrinsics, tracing


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


# What the compiler is given for functions of numbers, arrays and expressions.
COMPILED: dict[Callable[..., Any], Callable[..., Any]] = {
    tracing.root: root,
    tracing.magnitude: magnitude,
    tracing.where_less: where_less,
    tracing.clip: clip,
    tracing.at_least: at_least,
    tracing.floor: np.floor,
    tracing.quarter_turns: intrinsics.quarter_turns,
}
