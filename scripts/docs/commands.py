"""Write the tables of docs/reference/command_line.md from the parsers of `flexarm`."""

import argparse
import re
from collections.abc import Iterator
from importlib import import_module

from flexarm_agents.commands import VERBS
from flexarm_agents.commands.arguments import Reader
from flexarm_agents.commands.train import parser as training
from flexarm_agents.training.config import ALGORITHMS
from scripts.common.command_line import run
from scripts.common.markdown import fill_pages, table

BRIEF = 14  # words of a meaning that is left to the help


def text() -> str:
    """Write a section for each verb of `flexarm`."""
    parts: list[str] = []
    seen: dict[tuple[str, str], str] = {}  # each row, and the command that has it first
    for verb, (name, _) in VERBS.items():
        reader = import_module(f"flexarm_agents.commands.{name}").parser()
        about = " ".join((reader.description or "").partition("\n\n")[0].split())
        parts += [f"## `{reader.prog}`\n", f"{about}\n"]
        parts.append(algorithms() if verb == "train" else options_table(reader, seen))
    return "\n".join(filter(None, parts))


def options_table(reader: Reader, seen: dict[tuple[str, str], str]) -> str:
    """Write a command's options: in full what is long to say and new, by their names the others."""
    rows: list[tuple[str, str]] = []
    named: dict[str, list[str]] = {reader.prog: []}  # by the command that has them first
    for flags, meaning in options(reader):
        name = re.sub(r" [^`]+`", "`", flags)
        first = seen.setdefault((name, meaning), reader.prog)
        if first == reader.prog and len(meaning.split()) > BRIEF:
            rows.append((flags, meaning))
        else:
            named.setdefault(first, []).append(name)
    starts = {first: "" if first == reader.prog else f"as for `{first}`: " for first in named}
    names = "; ".join(starts[first] + ", ".join(several) for first, several in named.items() if several)
    parts = [table(("option", "meaning"), rows)] if rows else []
    return "\n".join([*parts, f"{'Also' if rows else 'Takes'} {names}.\n"] if names else parts)


def algorithms() -> str:
    """Name the options of `flexarm train`, by the algorithms that have them."""
    found: dict[str, list[str]] = {}
    for name in ALGORITHMS:
        for flags, _ in options(training(name)):
            for flag in re.findall(r"--[\w-]+", flags):
                found.setdefault(flag, []).append(name)
    by_algorithms: dict[str, list[str]] = {}
    for flag, names in found.items():
        whose = "all" if len(names) == len(ALGORITHMS) else ", ".join(f"`{name}`" for name in names)
        by_algorithms.setdefault(whose, []).append(f"`{flag}`")
    return "".join(f"- {whose}: {', '.join(flags)}.\n" for whose, flags in by_algorithms.items())


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
