"""Tables of docs/developers/reliability.md."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from scripts.common.markdown import table
from scripts.hardening.campaign import Part, Tally
from scripts.hardening.kills import TASKS

FLAT = 5.0  # growth that counts as none [MB]
OTHER = ", other code"  # than that which is there now
BLOCK = re.compile(r"<!-- generated: (\w+) -->\n(.*?)<!-- end -->", re.DOTALL)
STAMP = re.compile(rf"<!-- ([0-9a-f]{{8}})(?:{OTHER})? --> \|$")  # at the end of a line


class Code(NamedTuple):
    """By which code counts were made.

    Attributes:
        made: stamp of the code that made them.
        now: stamp of the code as it is.
    """

    made: str
    now: str

    def __str__(self) -> str:
        """Write a comment with the stamp that says whether the code is another one now."""
        return f"<!-- {self.made[:8]}{'' if self.made == self.now else OTHER} -->"


def fuzzing_table(parts: Mapping[str, Part], tallies: Mapping[str, Tally], codes: Mapping[str, Code]) -> str:
    """Write what was tried, how often, and the outcome."""
    rows = [
        [
            part.text,
            f"{tallies[name].total:,} {part.counted}s",
            ", ".join(f"{count:,} {end}" for end, count in sorted(tallies[name].ends.items())),
            f"{tallies[name].longest:.2f} s",
            f"{_count(tallies[name].faults)} {codes[name]}",
        ]
        for name, part in parts.items()
        if name in tallies
    ]
    head = ["what is tried", "how often", "outcome", "slowest case, processor time", "faults"]
    return table(head, rows)


def soak_table(runs: list[dict[str, Any]], code: Code | None) -> str:
    """Write a line for each process of the soak."""
    rows = [
        [
            f"{n}",
            f"{run['steps']:,}",
            f"{run['episodes']:,}",
            f"{run['settled']:.0f} MB, {run['end']:.0f} MB",
            f"{run['seconds']:.0f} s {code}",
        ]
        for n, run in enumerate(runs, 1)
    ]
    head = ["process", "steps", "episodes", "memory early on, at the end", "processor time"]
    return table(head, rows)


def kills_table(found: Mapping[str, Mapping[str, Any]], codes: Mapping[str, Code]) -> str:
    """Write how often each task was killed, and what came of it."""
    rows = [
        [
            task.text,
            f"{found[name]['kills']}",
            f"{found[name]['finished']}",
            f"{found[name]['seconds']:.0f} s",
            f"{_count(found[name]['faults'])} {codes[name]}",
        ]
        for name, task in TASKS.items()
        if name in found
    ]
    head = ["task", "kills", "completed", "time undisturbed", "faults"]
    return table(head, rows)


def joined(new: str, former: str, now: Mapping[str, str]) -> str:
    """Return a table with those lines of a former one for which it has none.

    Args:
        new: the table.
        former: the block of the page in which it will stand.
        now: first cell of each line that may be there, in their order, and the stamp of its code as it is now.
    """
    head, rule, *lines = new.splitlines()
    known = {_first(line): _marked(line, now[_first(line)]) for line in former.splitlines() if _first(line) in now}
    known |= {_first(line): line for line in lines}
    return "".join(f"{line}\n" for line in (head, rule, *(known[one] for one in now if one in known)))


def _first(line: str) -> str:
    """Return the first cell of a line."""
    return line.removeprefix("| ").partition(" | ")[0]


def _marked(line: str, now: str) -> str:
    """Say anew whether the code of a line is another one now."""
    return STAMP.sub(lambda found: f"{Code(found[1], now[:8])} |", line)


def _count(faults: Sequence[str]) -> str:
    return str(len(faults) or "none")
