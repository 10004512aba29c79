"""What each field of a set of parameters may be, declared once beside the field: unit, range, choices.

A frozen dataclass declares its fields by `declared` and checks them all by `check_fields` in its ``__post_init__``.
Messages, documentation and tests read the same declarations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, fields
from numbers import Real
from typing import Any, Protocol

from flexarm_env.validation import choice, flag, integer, number, pair


class Allowed(Protocol):
    """What a field may be."""

    @property
    def unit(self) -> str:
        """Physical unit; "" for none."""

    @property
    def text(self) -> str:
        """The allowed values in words, for the documentation."""

    def check(self, name: str, value: Any) -> Any:
        """Return the value in its canonical type."""


@dataclass(frozen=True)
class Number:
    """A finite number in [least, most].

    Attributes:
        least: lowest value.
        most: highest value.
        unit: physical unit.
    """

    least: float
    most: float
    unit: str = ""

    @property
    def text(self) -> str:
        """See `Allowed`."""
        return f"{self.least:.6g} to {self.most:.6g}"

    def check(self, name: str, value: Any) -> Any:
        """See `Allowed`."""
        return number(name, value, self.unit, least=self.least, most=self.most)


@dataclass(frozen=True)
class Pair(Number):
    """Two finite numbers, one for each link or joint, each in [least, most]."""

    def check(self, name: str, value: Any) -> Any:
        """See `Allowed`."""
        return pair(name, value, self.unit, least=self.least, most=self.most)


@dataclass(frozen=True)
class ZeroOr(Number):
    """0, or a finite number in [least, most]."""

    @property
    def text(self) -> str:
        """See `Allowed`."""
        return f"0, or {super().text}"

    def check(self, name: str, value: Any) -> Any:
        """See `Allowed`."""
        zero = isinstance(value, Real) and not isinstance(value, bool) and value == 0
        return 0.0 if zero else super().check(name, value)


@dataclass(frozen=True)
class Integer:
    """An integer in [least, most].

    Attributes:
        least: lowest value.
        most: highest value.
        unit: none.
    """

    least: int
    most: int
    unit: str = ""

    @property
    def text(self) -> str:
        """See `Allowed`."""
        return f"{self.least} to {self.most}"

    def check(self, name: str, value: Any) -> Any:
        """See `Allowed`."""
        return integer(name, value, self.least, self.most)


@dataclass(frozen=True)
class OneOf:
    """One of some names.

    Attributes:
        names: the names.
        unit: none.
    """

    names: tuple[str, ...]
    unit: str = ""

    @property
    def text(self) -> str:
        """See `Allowed`."""
        return ", ".join(f'"{name}"' for name in self.names)

    def check(self, name: str, value: Any) -> Any:
        """See `Allowed`."""
        return choice(name, value, self.names)


@dataclass(frozen=True)
class Flag:
    """True or False.

    Attributes:
        unit: none.
        text: see `Allowed`.
    """

    unit: str = ""
    text: str = "True, False"

    def check(self, name: str, value: Any) -> Any:
        """See `Allowed`."""
        return flag(name, value)


@dataclass(frozen=True)
class Custom:
    """What a function checks.

    Attributes:
        function: takes the name and the value, and returns the value in its canonical type.
        unit: physical unit.
        text: see `Allowed`.
    """

    function: Callable[[str, Any], Any]
    unit: str = ""
    text: str = ""

    def check(self, name: str, value: Any) -> Any:
        """See `Allowed`."""
        return self.function(name, value)


@dataclass(frozen=True)
class Optional:
    """None, or what another declaration allows.

    Attributes:
        other: that declaration.
    """

    other: Allowed

    @property
    def unit(self) -> str:
        """See `Allowed`."""
        return self.other.unit

    @property
    def text(self) -> str:
        """See `Allowed`."""
        return f"None, or {self.other.text}" if self.other.text else ""

    def check(self, name: str, value: Any) -> Any:
        """See `Allowed`."""
        return None if value is None else self.other.check(name, value)


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
