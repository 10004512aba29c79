"""How the tests ask for a good error message."""

import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest


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


def called(call: Any) -> object:
    return call()


def refused(
    *cases: tuple[Any, str],
    by: Callable[[Any], object] = called,
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
