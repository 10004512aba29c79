"""What each field of a set of parameters may be, declared once beside the field: unit, range, choices.

A frozen dataclass declares its fields by `declared` and checks them all by `check_fields` in its ``__post_init__``.
Messages, documentation and tests read the same declarations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field, fields
from functools import partial
from numbers import Real
from typing import Any

from flexarm_env.validation import choice, flag, integer, number, pair

Check = Callable[[str, Any], Any]


class Allowed:
    """What a field may be.

    Attributes:
        check: takes the name and the value, and returns the value in its canonical type.
        unit: physical unit; "" for none.
        text: the allowed values in words, for the documentation.
    """

    def __init__(self, check: Check, unit: str = "", text: str = "") -> None:
        self.check, self.unit, self.text = check, unit, text


class Custom(Allowed):
    """What a function checks, as declared by itself."""


class Number(Allowed):
    """A finite number in [least, most]."""

    def __init__(self, least: float, most: float, unit: str = "") -> None:
        self.least, self.most = least, most
        super().__init__(partial(number, unit=unit, least=least, most=most), unit, f"{least:.6g} to {most:.6g}")


class Pair(Number):
    """Two finite numbers, one for each link or joint, each in [least, most]."""

    def __init__(self, least: float, most: float, unit: str = "") -> None:
        super().__init__(least, most, unit)
        self.check = partial(pair, unit=unit, least=least, most=most)


class ZeroOr(Number):
    """0, or a finite number in [least, most]."""

    def __init__(self, least: float, most: float, unit: str = "") -> None:
        super().__init__(least, most, unit)
        self.check, self.text = partial(_zero_or, self.check), f"0, or {self.text}"


def _zero_or(other: Check, name: str, value: Any) -> Any:
    zero = isinstance(value, Real) and not isinstance(value, bool) and value == 0
    return 0.0 if zero else other(name, value)


class Integer(Allowed):
    """An integer in [least, most]."""

    def __init__(self, least: int, most: int) -> None:
        self.least, self.most = least, most
        super().__init__(partial(integer, least=least, most=most), text=f"{least} to {most}")


class OneOf(Allowed):
    """One of some names."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = tuple(names)
        super().__init__(partial(choice, allowed=self.names), text=", ".join(f'"{name}"' for name in names))


class Flag(Allowed):
    """True or False."""

    def __init__(self) -> None:
        super().__init__(flag, text="True, False")


class Optional(Allowed):
    """None, or what another declaration allows."""

    def __init__(self, other: Allowed) -> None:
        self.other = other
        text = f"None, or {other.text}" if other.text else ""
        super().__init__(partial(_none_or, other.check), other.unit, text)


def _none_or(other: Check, name: str, value: Any) -> Any:
    return None if value is None else other(name, value)


def declared(default: Any, allowed: Allowed, name: str | None = None, **metadata: Any) -> Any:
    """Declare a dataclass's field.

    Args:
        default: its value unless given; a dict is copied.
        allowed: what it may be.
        name: name of the field in messages, where users give it by another name.
        **metadata: further entries of the field's metadata.
    """
    entries = {"allowed": allowed, "name": name, **metadata}
    if isinstance(default, dict):
        return field(default_factory=default.copy, metadata=entries)
    return field(default=default, metadata=entries)


def allowed_of(kind: type, name: str) -> Allowed:
    """Return what a field of a dataclass may be."""
    found: Allowed = kind.__dataclass_fields__[name].metadata["allowed"]  # type: ignore[attr-defined]
    return found


def check_fields(instance: Any) -> None:
    """Check all fields of a frozen dataclass and bring them to their canonical types."""
    for one in fields(instance):
        checked = one.metadata["allowed"].check(one.metadata["name"] or one.name, getattr(instance, one.name))
        object.__setattr__(instance, one.name, checked)
