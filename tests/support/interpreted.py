"""Recorded kernels as Python runs their text."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np

from flexarm_env.codegen.declarations import Recorded
from flexarm_env.codegen.tracing import quarter_turns
from flexarm_env.kernels.recorder import CALLED
from flexarm_env.kernels.variants import Variant


def interpreted(
    variant: Variant, kernel: Recorded[..., Any], fused: Callable[[float, float, float], float]
) -> Callable[..., Any]:
    """Return a kernel as Python runs its text, with a multiplication-and-addition of our choice."""
    names: dict[str, Any] = {"floor": np.floor, "fused": fused, "quarter_turns": quarter_turns}
    for function in (*CALLED, kernel):
        if isinstance(function, Recorded):
            exec(function.formula(variant), names)
    return names[kernel.__name__]


def rounded_once(a: float, b: float, c: float) -> float:
    return float(Fraction(float(a)) * Fraction(float(b)) + Fraction(float(c)))
