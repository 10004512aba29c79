"""The check of a value's class that every function of the analysis shares."""

from __future__ import annotations

from typing import Any

from flexarm_env.validation import shown


def instance(name: str, value: object, allowed: type[Any]) -> None:
    """Refuse a value of another class.

    Args:
        name: parameter name for the message.
        value: what the user gave.
        allowed: the class.

    Raises:
        TypeError: naming the parameter, the value and the class.
    """
    if not isinstance(value, allowed):
        article = "an" if allowed.__name__[0] in "AEIOU" else "a"
        raise TypeError(f"{name} = {shown(value)}: must be {article} {allowed.__name__}")
