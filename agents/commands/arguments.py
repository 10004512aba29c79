"""Arguments that several verbs share."""

from __future__ import annotations

import argparse
import json
import shutil
from typing import Any


def reader(verb: str, description: str) -> argparse.ArgumentParser:
    """Make a parser of a verb's arguments; options cannot be abbreviated: a new one never changes another.

    Args:
        verb: e.g. "list".
        description: the verb's help.
    """
    form = argparse.RawDescriptionHelpFormatter
    return argparse.ArgumentParser(
        prog=f"flexarm {verb}", description=description, formatter_class=form, allow_abbrev=False
    )


def json_object(text: str) -> dict[str, Any]:
    """Read a JSON object.

    Raises:
        ValueError: if the text is something else.
    """
    try:
        value = json.loads(text)
    except ValueError as error:
        raise ValueError(f"{text}: not JSON ({error})") from None
    if not isinstance(value, dict):
        raise ValueError(f"{text}: must be a JSON object")
    return value


def add_options(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the argument `--options`, environment options as JSON.

    Args:
        parser: gets the argument.
        what: the options are of.
    """

    def read(text: str) -> dict[str, Any]:
        try:
            return json_object(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    parser.add_argument("--options", type=read, default={}, metavar="JSON", help=f'{what}, e.g. {{"noise": 0.005}}')


def width() -> int:
    """Return the width of a line of the terminal; 100 where there is none."""
    return shutil.get_terminal_size((100, 24)).columns
