"""Write the tables of docs/reference/command_line.md: options of `flexarm` and of the studies, from their parsers."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator
from importlib import import_module

from flexarm_agents.commands import VERBS
from flexarm_agents.commands.arguments import EXAMPLES, Reader
from flexarm_agents.commands.leaderboard import parser as board
from flexarm_agents.commands.train import parser as training
from flexarm_agents.training.config import ALGORITHMS
from scripts import train as trainings
from scripts.analysis import __main__ as analysis
from scripts.common.command_line import parser, run
from scripts.common.markdown import fill_pages, table
from scripts.common.study import usual
from scripts.control import __main__ as control
from scripts.leaderboard import __main__ as whole_board
from scripts.learning import __main__ as learning

STUDIES = ("paper", "optimise", "benchmarks", "shipped", "make_dataset")


def text() -> str:
    """Write a section for each verb of `flexarm` and for each study."""
    parts = []
    for verb, (name, _) in VERBS.items():
        parts += section(import_module(f"flexarm_agents.commands.{name}").parser())
        parts.append("```console\n" + "\n".join(EXAMPLES[verb]) + "\n```\n")
        if verb == "train":
            for other in [*ALGORITHMS][1:]:
                parts += further(f"### `flexarm train --algorithm {other}`", training(), training(other))
    for name in STUDIES:
        package = import_module(f"scripts.{name}")
        module = package if hasattr(package, "Options") else import_module(f"scripts.{name}.__main__")
        parts += section(parser(f"python -m scripts.{name}", module.Options()))
    for name, one in {"analysis": analysis, "control": control, "learning": learning}.items():
        parts += section(parser(f"python -m scripts.{name}", usual(name, one.STUDIES), one.TEXT))
    parts += further("## `python -m scripts.leaderboard`, beside `flexarm leaderboard`", board(), whole_board.parser())
    sweep = parser("python -m scripts.train", trainings.Options())
    parts += further("## `python -m scripts.train`, beside `flexarm train`", training(), sweep)
    return "\n".join(parts)


def section(reader: Reader) -> list[str]:
    """Write the name of a command, what it does, and its options."""
    about, rows = (reader.description or "").partition("\n\n")[0].split(), list(options(reader))
    return [f"## `{reader.prog}`\n", f"{' '.join(about)}\n", *([table(("option", "meaning"), rows)] if rows else [])]


def further(title: str, first: Reader, reader: Reader) -> list[str]:
    """Write the options that a command has beside those of another one."""
    common = list(options(first))
    rows = [row for row in options(reader) if row not in common]
    return [f"{title}\n", table(("option", "meaning"), rows)]


def options(reader: Reader) -> Iterator[tuple[str, str]]:
    """Yield each option that the help shows with its values, and what it means."""
    for one in reader.declared:
        flags = one.option_strings[: 1 if one.default is False else None]
        value = str(one.metavar or (f"{{{','.join(map(str, one.choices))}}}" if one.choices else ""))
        value += " ..." if one.nargs in ("+", "*") else ""
        meaning = re.sub(r" \(default: (%\(default\)s|False)\)$", "", " ".join((one.help or "").split())).replace(
            "%%", "%"
        )
        meaning = re.sub(r"(?<!`)(--[\w-]+|{[^{}]*})", r"`\1`", meaning)  # typographers would change them
        if "--help" not in flags and one.help != argparse.SUPPRESS:
            yield ", ".join(f"`{f'{flag} {value}'.strip()}`" for flag in flags or [""]), meaning


def main() -> None:
    """Command line."""
    print(*fill_pages({"command_line": text()}))


if __name__ == "__main__":
    run(main)
