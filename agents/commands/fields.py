"""The fields of a configuration as arguments of a verb: their types, their defaults, their docstrings."""

import argparse
import ast
import inspect
import json
from collections.abc import Callable
from dataclasses import fields, is_dataclass
from itertools import pairwise
from types import NoneType
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from flexarm_agents.commands.arguments import Reader, json_argument

Config = TypeVar("Config")


def add_fields(reader: Reader, defaults: Any) -> None:
    """Add an argument for each field."""
    texts, hints = _descriptions(type(defaults)), get_type_hints(type(defaults))
    for one in fields(defaults):
        value = getattr(defaults, one.name)
        shown = f"{texts[one.name]}{_shown(value)}".replace("%", "%%")
        reader.add_argument(f"--{one.name.replace('_', '-')}", default=value, help=shown, **_reading(hints[one.name]))


def read_fields(reader: Reader, kind: type[Config], given: argparse.Namespace) -> Config:
    """Make a configuration from parsed arguments; a bad value ends the command as wrong usage."""
    names = [one.name for one in fields(kind)]  # type: ignore[arg-type]
    try:
        return kind(**{name: getattr(given, name) for name in names})
    except (TypeError, ValueError) as error:
        reader.error(str(error))


def _descriptions(kind: type) -> dict[str, str]:
    """Return the docstrings under the fields of a class and of those that it extends."""
    found = {}
    for one in filter(is_dataclass, reversed(kind.__mro__)):
        (definition,) = ast.parse(inspect.getsource(one)).body
        assert isinstance(definition, ast.ClassDef)
        for field, text in pairwise(definition.body):
            if isinstance(field, ast.AnnAssign) and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
                found[ast.unparse(field.target)] = " ".join(str(text.value.value).split())
    return found


def _shown(value: Any) -> str:
    """Write a default for the end of a help text; nothing for one without content."""
    if value is None or (isinstance(value, tuple | dict) and not value):
        return ""
    text = " ".join(map(str, value)) if isinstance(value, tuple) else value
    return f" (default: {json.dumps(value) if isinstance(value, dict) else text})"


def _reading(hint: Any) -> dict[str, Any]:
    if NoneType in get_args(hint):
        (inner,) = set(get_args(hint)) - {NoneType}
        reading = _reading(inner)
        return reading | {"type": _or_none(reading["type"])}
    if hint is bool:
        return {"action": argparse.BooleanOptionalAction}
    if get_origin(hint) is dict:
        return {"type": json_argument, "metavar": "JSON"}
    if get_origin(hint) is Literal:
        return {"choices": get_args(hint)}
    if get_origin(hint) is tuple:
        first, *others = get_args(hint)
        return _reading(first) | {"nargs": "*" if others == [...] else 1 + len(others)}
    return {"type": hint, "metavar": hint.__name__.upper()}


def _or_none(read: Callable[[str], Any]) -> Callable[[str], Any]:
    def value(text: str) -> Any:
        return None if text == "None" else read(text)

    value.__name__ = getattr(read, "__name__", "value")  # argparse names it in messages
    return value
