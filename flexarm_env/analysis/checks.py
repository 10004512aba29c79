"""The check of a value's class that every function of the analysis shares."""

from __future__ import annotations

from typing import Any


def instance(name: str, value: object, *allowed: type[Any]) -> None:
    """Refuse a value of another class.

    Args:
        name: parameter name for the message.
        value: what the user gave.
        allowed: the classes.

    Raises:
        TypeError: naming the parameter, the value and the classes.
    """
    if not isinstance(value, allowed):
        raise TypeError(f"{name} = {value!r}: must be a {' or a '.join(kind.__name__ for kind in allowed)}")
