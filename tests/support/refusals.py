"""How the tests ask for a good error message."""

import math
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from operator import call
from typing import Any

import numpy as np
import pytest

from flexarm_env.allowed import Allowed, Flag, Integer, Number, OneOf, Optional, Pair


@contextmanager
def refuses(kind: type[Exception] | tuple[type[Exception], ...], *words: str) -> Iterator[None]:
    """Check that the error is of this kind and says all of this: parameter, value, what is allowed."""
    with pytest.raises(kind) as caught:
        yield
    for word in words:
        assert word in str(caught.value)


def label(value: object) -> str:
    """Return a short name of a parametrised value, the same in every process."""
    return re.sub(r" at 0x[0-9a-f]+", "", str(value))[:40]


def refused(
    *cases: tuple[Any, str],
    by: Callable[[Any], object] = call,
    kind: type[Exception] | tuple[type[Exception], ...] = ValueError,
) -> Callable[[Any, str], None]:
    """Make a test of a table of what is refused: calls, or what `by` is called with, each with a pattern of the text.

    "TypeError: " before the pattern says that the error is of this kind; others are of `kind`.
    """

    @pytest.mark.parametrize(("given", "message"), cases, ids=[label(message) for _, message in cases])
    def test_refused(given: Any, message: str) -> None:
        text = message.removeprefix("TypeError: ")
        with pytest.raises(kind if text == message else TypeError, match=text):
            by(given)

    return test_refused


def wrong_values(name: str, allowed: Allowed) -> list[tuple[Any, type[Exception], str]]:
    """Return values that a declaration does not allow, with the error and its message; none for functions' checks."""
    if isinstance(allowed, Optional):
        return [each for each in wrong_values(name, allowed.other) if each[0] is not None]
    if isinstance(allowed, Pair):
        each = wrong_values(f"{name}[1]", Number(allowed.least, allowed.most, allowed.unit))
        pairs = [((allowed.least, value), error, message) for value, error, message in each]
        return [*pairs, (0.5, TypeError, f"{name} = 0.5: must be a pair of numbers [{allowed.unit}]")]
    if isinstance(allowed, Number):
        unit = f" [{allowed.unit}]" if allowed.unit else ""
        rule = f"must be a finite number and >= {allowed.least} and <= {allowed.most}{unit}"
        beyond = [math.nextafter(allowed.least, -math.inf), math.nextafter(allowed.most, math.inf), math.nan]
        wrong = [(value, ValueError) for value in beyond] + [(value, TypeError) for value in ("1", True)]
        return [(value, error, f"{name} = {value!r}: {rule}") for value, error in wrong]
    if isinstance(allowed, Integer):
        rule = f"must be an integer from {allowed.least} to {allowed.most}"
        wrong = [(value, ValueError) for value in (allowed.least - 1, allowed.most + 1, 10**400)]
        wrong += [(value, TypeError) for value in (1.0, True, "2", None, math.nan)]
        return [(value, error, f"{name} = {value!r}: {rule}") for value, error in wrong]
    if isinstance(allowed, OneOf):
        rule = f"must be one of {', '.join(map(repr, allowed.names))}"
        wrong = [(value, ValueError) for value in ("other", "", 1, None, True, ("x",), np.ones(2))]
        return [(value, error, f"{name} = {value!r}: {rule}") for value, error in wrong]
    return [(1, TypeError, f"{name} = 1: must be True or False")] if isinstance(allowed, Flag) else []


def right_values(allowed: Allowed) -> list[Any]:
    """Return what a declaration just allows: its bounds, or its names."""
    if isinstance(allowed, Optional):
        return right_values(allowed.other)
    if isinstance(allowed, Number | Integer):
        bounds = [allowed.least, allowed.most]
        return [(one, one) for one in bounds] if isinstance(allowed, Pair) else bounds
    return list(allowed.names) if isinstance(allowed, OneOf) else []
