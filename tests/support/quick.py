"""Drivers in plain Python in half the time, to the same bits: what they ask for in every line is remembered.

A driver reads thousands of its variant's attributes and of places in tables in a period, each worked out anew, and its
formulas, which take arrays too, work on single numbers. This belongs in `flexarm_env.codegen`, whose code is part of
what decides the arms of the leaderboard's entries: it moves there with the next edition of the board.
"""

from collections.abc import Callable, Sequence
from inspect import unwrap
from math import isfinite
from typing import Any

import numpy as np
import pytest

from flexarm_env.codegen import declarations, plain, tracing
from flexarm_env.codegen.declarations import Entry, Names, PresentVariant


def quicken(patch: pytest.MonkeyPatch) -> None:
    """Let drivers in plain Python take less time; what is recorded or compiled is the same."""
    patch.setattr(Entry, "__get__", _place)
    patch.setattr(PresentVariant, "__getattr__", _attribute)
    patch.setattr(tracing, "_asked", _asked)


_WORKED_OUT, _ASKED = Entry.__get__, tracing._asked


def _place(entry: Entry, table: Names | None, owner: type) -> Any:
    present = declarations._PRESENT.get(None)
    if table is None or present is None:
        return _WORKED_OUT(entry, table, owner)
    known: dict[Any, Any] = present.places
    if entry not in known:
        known[entry] = _WORKED_OUT(entry, table, owner)
    return known[entry]


def _attribute(_: PresentVariant, name: str) -> Any:
    present = declarations._of_context()
    known: dict[Any, Any] = present.places
    if name not in known:
        known[name] = getattr(present.variant, name)
    return known[name]


class _Numbers(tracing.Symbol):
    """Stands for arguments that are single numbers, which need none of numpy's detours for arrays."""

    def apply(self, function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
        if function not in _OF_NUMBERS:
            _OF_NUMBERS[function] = unwrap(function)
        return _OF_NUMBERS[function](*arguments)


def _where_less(x: float, bound: float, then: float, otherwise: float) -> float:
    return then if x < bound else otherwise


def _quarter_turns(k: float, sine: float, cosine: float) -> tuple[float, float]:
    of_one: Any = plain._quarter_turns if isfinite(k) else unwrap(tracing.quarter_turns)
    found: tuple[float, float] = of_one(k, sine, cosine)
    return found


_OF_NUMBERS: dict[Any, Any] = {tracing.quarter_turns: _quarter_turns, tracing.where_less: _where_less}
_NUMBERS = _Numbers()


def _asked(arguments: Sequence[Any]) -> tracing.Symbol | None:
    for argument in arguments:
        if type(argument) is not float and type(argument) is not np.float64:
            return _ASKED(arguments)
    return _NUMBERS
