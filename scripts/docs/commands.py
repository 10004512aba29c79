"""Write the tables of docs/reference/command_line.md from the parsers of `flexarm`."""

from __future__ import annotations

import argparse
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from importlib import import_module

from flexarm_agents.commands import VERBS
from flexarm_agents.commands.arguments import Reader
from flexarm_agents.commands.train import parser as training
from flexarm_agents.training.config import ALGORITHMS
from scripts.common.command_line import run
from scripts.common.markdown import fill_pages, table

SHARED = 4  # algorithms that have an option which the page explains
DEFAULT = re.compile(r" \(default: (.*)\)$")


def text() -> str:
    """Write a section for each verb of `flexarm`."""
    parts: list[str] = []
    seen: dict[tuple[str, str], str] = {}  # each row, and the command that has it first
    for verb, (name, _) in VERBS.items():
        reader = import_module(f"flexarm_agents.commands.{name}").parser()
        parts += [f"## `{reader.prog}`\n", f"{about(reader)}\n"]
        parts.append(algorithms() if verb == "train" else options_table(reader, seen))
    return "\n".join(parts)


def about(reader: Reader) -> str:
    """Return what a command does: the first paragraph of its help."""
    return " ".join((reader.description or "").partition("\n\n")[0].split())


def options_table(reader: Reader, seen: dict[tuple[str, str], str]) -> str:
    """Write a command's options; of those that an earlier one has with the same meaning, the names."""
    new, old = split(reader, seen)
    return (table(("option", "meaning"), new) if new else "") + (f"\n{old.strip()}\n" if old else "")


def split(reader: Reader, seen: dict[tuple[str, str], str]) -> tuple[list[tuple[str, str]], str]:
    """Return a command's new rows, which come into `seen`, and a sentence with the names of the others."""
    rows = list(options(reader))
    old: dict[str, list[str]] = {}
    for row in rows:
        if row in seen:
            old.setdefault(seen[row], []).append(row[0])
    new = [row for row in rows if row not in seen]
    seen.update(dict.fromkeys(new, reader.prog))
    return new, "".join(f" As for `{prog}`: {', '.join(names)}." for prog, names in old.items())


def algorithms() -> str:
    """Write the options of `flexarm train` that most algorithms have, with the defaults where they differ."""
    found: dict[str, dict[str, tuple[str, str]]] = {}
    for name in ALGORITHMS:
        for flags, meaning in options(training(name)):
            default = DEFAULT.search(meaning)
            found.setdefault(flags, {})[name] = DEFAULT.sub("", meaning), default[1] if default else ""
    shown = {f"{flags}{_of(of)}": of for flags, of in found.items() if len(of) >= SHARED}
    rows = [
        [flags, *(by_algorithm([one[at] for one in of.values()], of) for at in (0, 1))] for flags, of in shown.items()
    ]
    return table(("option", "meaning", "default"), rows) + "\n".join(("", *_own(found), ""))


def _own(found: Mapping[str, Collection[str]]) -> Iterator[str]:
    """Name the options of one algorithm or two, whose meanings its help prints."""
    for name in ALGORITHMS:
        flags = [
            re.sub(r"[`,].*", "", one[1:]).split()[0] for one, of in found.items() if name in of and len(of) < SHARED
        ]
        yield f"- `{name}` also has {', '.join(f'`{flag}`' for flag in flags)}."


def _of(names: Collection[str]) -> str:
    return "" if len(names) == len(ALGORITHMS) else f" *({', '.join(names)})*"


def by_algorithm(texts: list[str], names: Iterable[str]) -> str:
    """Write the texts of those algorithms that have an option: one alone if all have the same."""
    of: dict[str, list[str]] = {}
    for text, name in zip(texts, names, strict=True):
        of.setdefault(text, []).append(name)
    return texts[0] if len(of) == 1 else "; ".join(f"*{', '.join(of[one])}*: {one.rstrip('.')}" for one in of if one)


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
