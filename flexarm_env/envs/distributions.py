"""Distributions of what is drawn for each episode: plain values, as options have them in JSON.

    (low, high)                                uniform
    ("log_uniform", low, high)                 the logarithm is uniform
    ("normal", mean, deviation, low, high)     normal, cut at both ends
    ("choice", (one, other, ...))              each of some numbers with the same probability

A number in [0, 1) gives a value by the inverse of the distribution function.
"""

from __future__ import annotations

from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flexarm_env.allowed import Number
from flexarm_env.validation import choice, entries, listed, number, pair, shown

Array = NDArray[np.float64]
LENGTHS = {"log_uniform": 3, "normal": 5, "choice": 2}  # with the name
LEAST_SHARE = 1e-6  # of a normal distribution between its cuts: further out it has too few digits


def checked_distribution(label: str, value: Any, allowed: Number) -> tuple[Any, ...]:
    """Check what a user gave as the distribution of a number."""
    limits: dict[str, Any] = {"unit": allowed.unit, "least": allowed.least, "most": allowed.most}
    parts = entries(value) or [None]
    if not isinstance(parts[0], str):
        return _checked_ends(label, value, pair(label, value, **limits))
    name = choice(f"{label}[0]", parts[0], LENGTHS)
    if len(parts) != LENGTHS[name]:
        raise ValueError(f"{label} = {shown(value)}: must have {LENGTHS[name] - 1} entries after {name!r}")
    if name == "choice":
        values = listed(f"{label}[1]", parts[1])
        if not values:
            raise ValueError(f"{label} = {shown(value)}: must name a number at least")
        return name, tuple(number(f"{label}[1][{n}]", x, **limits) for n, x in enumerate(values))
    low, high = _checked_ends(label, value, pair(f"{label}[-2:]", parts[-2:], **limits))
    if name == "log_uniform":
        return name, number(f"{label}[1]", low, allowed.unit, above=0.0), high
    mean = number(f"{label}[1]", parts[1], allowed.unit)
    deviation = number(f"{label}[2]", parts[2], allowed.unit, above=0.0)
    if not _share(NormalDist(mean, deviation), low, high) >= LEAST_SHARE:
        raise ValueError(f"{label} = {shown(value)}: less than {LEAST_SHARE:g} of the distribution is in its range")
    return name, mean, deviation, low, high


def _checked_ends(label: str, value: Any, ends: tuple[float, float]) -> tuple[float, float]:
    if ends[0] > ends[1]:
        raise ValueError(f"{label} = {shown(value)}: the first must not be above the second")
    return ends


def _share(normal: NormalDist, low: float, high: float) -> float:
    return normal.cdf(high) - normal.cdf(low)


def ends_of(distribution: tuple[Any, ...]) -> tuple[float, float]:
    """Return the least and the largest value."""
    if distribution[0] == "choice":
        return min(distribution[1]), max(distribution[1])
    return distribution[-2], distribution[-1]


def quantiles(distribution: tuple[Any, ...], shares: Array) -> Array:
    """Return the values below which the distribution has these shares. Shape (n,) each."""
    low, high = ends_of(distribution)
    name = distribution[0]
    if name == "choice":
        return np.array(distribution[1])[(shares * len(distribution[1])).astype(int)]
    if name == "log_uniform":
        return np.clip([low * (high / low) ** share for share in shares.tolist()], low, high)
    if name == "normal":
        normal = NormalDist(*distribution[1:3])
        found = normal.cdf(low) + shares * _share(normal, low, high)
        return np.clip([normal.inv_cdf(share) for share in np.clip(found, 5e-324, 1.0 - 2**-53).tolist()], low, high)
    return low + (high - low) * shares
