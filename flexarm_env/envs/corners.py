"""The corners of what episodes may draw: the settings for which memory, integration step and bounds are laid out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np

from flexarm_env.envs.consistency import SWITCHES
from flexarm_env.envs.distributions import ends_of
from flexarm_env.envs.options import DRAWABLE, each_of
from flexarm_env.envs.quantities import QUANTITIES


def further_draws(settings: Any) -> dict[str, tuple[Any, ...]]:
    """Return the distributions of each option and parameter of the arm that is drawn, one for each of its numbers."""
    names = [name for name in DRAWABLE if name in settings.randomisation and name not in QUANTITIES]
    return {name: each_of(name, settings.randomisation[name]) for name in names}


def ends(settings: Any) -> tuple[Any, ...]:
    """Return the settings with the least and those with the largest values; empty where none of them is drawn."""
    found = {name: np.array([ends_of(one) for one in each]) for name, each in further_draws(settings).items()}
    return tuple(settings.having({name: both[:, n] for name, both in found.items()}) for n in (0, 1) if found)


def as_given(settings: Any) -> dict[str, Any]:
    """Return the options of one of `ends` as a user would give them: without what a switch that is 0 makes idle."""
    given = {one.name: getattr(settings, one.name) for one in fields(settings)}
    idle = {name for switch, of in SWITCHES.items() if not np.any(given[switch]) for name in of}
    return {name: value for name, value in given.items() if name not in idle} | {"start_spread": None}


def worst(settings: Any, measure: Callable[[Any], float]) -> Any:
    """Return the settings of the episodes with the largest measure; `settings` itself where nothing is drawn.

    Args:
        settings: `Settings`.
        measure: of settings; each number that is drawn either raises or lowers it, whatever the others are.
    """
    draws, found = further_draws(settings), settings
    values = {name: np.array([ends_of(one)[1] for one in each]) for name, each in draws.items()}
    for name, each in draws.items():
        for n, one in enumerate(each):
            tried = []
            for end in reversed(ends_of(one)):
                values[name][n] = end
                tried.append((settings.having(values), end))
            found, values[name][n] = max(tried, key=lambda pair: measure(pair[0]))
    return found
