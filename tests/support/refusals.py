"""How the tests ask for a good error message."""

import re
from collections.abc import Iterator
from contextlib import contextmanager

import pytest


@contextmanager
def refuses(kind: type[Exception], *words: str) -> Iterator[None]:
    """Check that the error is of this kind and says all of this: parameter, value, what is allowed."""
    with pytest.raises(kind) as caught:
        yield
    for word in words:
        assert word in str(caught.value)


def label(value: object) -> str:
    """Return a short name of a parametrised value, the same in every process."""
    return re.sub(r" at 0x[0-9a-f]+", "", str(value))[:40]
