"""Write the tables of docs/reference/command_line.md: options of `flexarm` and of the studies, from their parsers."""

from __future__ import annotations

import argparse
import re
import warnings
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any
from unittest import mock

import tyro

from flexarm_agents.commands import VERBS
from flexarm_agents.commands.arguments import EXAMPLES
from scripts.common.command_line import run
from scripts.common.markdown import fill_pages, table

STUDIES = ("paper", "validation", "analysis", "optimise", "control", "learning", "benchmarks")


def text() -> str:
    """Write a section for each verb of `flexarm` and for each study."""
    parts = []
    for verb, (name, _) in VERBS.items():
        reads = partial(import_module(f"flexarm_agents.commands.{name}").run, [])
        parts += [*section(reads), "```console\n" + "\n".join(EXAMPLES[verb]) + "\n```\n"]
    modules = [*(f"scripts.{name}.__main__" for name in STUDIES), "scripts.make_dataset"]
    return "\n".join((*parts, *(line for name in modules for line in section(import_module(name).main))))


def section(command: Callable[[], None]) -> list[str]:
    """Write the name of a command that reads its arguments first, what it does, and its options."""
    parser = parser_of(command)
    about, rows = (parser.description or "").partition("\n\n")[0].split(), list(options(parser))
    return [f"## `{parser.prog}`\n", f"{' '.join(about)}\n", *([table(("option", "meaning"), rows)] if rows else [])]


def parser_of(command: Callable[[], None]) -> argparse.ArgumentParser:
    """Return the parser with which a command reads its arguments, without running it."""

    def of_tyro(kind: Any, args: Any = None, description: str | None = None, **given: Any) -> None:
        with warnings.catch_warnings(action="ignore", category=DeprecationWarning):  # there is no other way to it
            found(tyro.extras.get_parser(kind, description=description or kind.__doc__, **given))

    def found(parser: Any, *given: Any) -> None:
        raise StopIteration(parser)

    with mock.patch.object(argparse.ArgumentParser, "parse_args", found), mock.patch.object(tyro, "cli", of_tyro):
        try:
            command()
        except StopIteration as stopped:
            return stopped.value
    raise ValueError(f"command = {command}: reads no arguments")


def options(parser: argparse.ArgumentParser) -> Iterator[tuple[str, str]]:
    """Yield each option with its values, and what it means."""
    for one in parser._actions:
        flags = one.option_strings[: 1 if one.default is False else None]
        value = str(one.metavar or (f"{{{','.join(one.choices)}}}" if one.choices else "")).removeprefix("{None}|")
        value = re.sub(r"^\[(.*) \[.*\]\]$", r"\1", value) + (" ..." if one.nargs in ("+", "*") else "")
        meaning = re.sub(r" ?\(default: (None|False|'{}'|)\)$", "", " ".join((one.help or "").split()))
        meaning = re.sub(r"(?<!`)(--[\w-]+|{[^{}]*})", r"`\1`", meaning)  # typographers would change them
        if "--help" not in flags:
            yield ", ".join(f"`{f'{flag} {value}'.strip()}`" for flag in flags or [""]), meaning


def main(folder: Path = Path("results/docs")) -> None:
    """Command line; the tables go into a folder, too."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "command_line.md").write_text(text(), encoding="utf-8")
    print(*fill_pages(folder, ["command_line"]))


if __name__ == "__main__":
    run(lambda: tyro.cli(main, prog="python -m scripts.docs.commands"))
