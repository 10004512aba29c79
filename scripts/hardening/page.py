"""Tables of docs/reliability.md."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from scripts.common.markdown import table
from scripts.hardening.campaign import Part, Tally
from scripts.hardening.kills import TASKS

FLAT = 5.0  # growth that counts as none [MB]


def fuzzing_table(parts: Mapping[str, Part], tallies: Mapping[str, Tally]) -> str:
    """Write what was tried, how often, and what came of it."""
    rows = [
        [
            part.text,
            f"{tallies[name].total:,} {part.counted}s",
            ", ".join(f"{count:,} {end}" for end, count in sorted(tallies[name].ends.items())),
            f"{tallies[name].longest:.2f} s",
            str(len(tallies[name].faults) or "none"),
        ]
        for name, part in parts.items()
        if name in tallies
    ]
    return table(["what is tried", "how often", "what came of it", "slowest case, processor time", "faults"], rows)


def soak_table(runs: list[dict[str, Any]]) -> str:
    """Write a line for each process of the soak."""
    rows = [
        [
            f"{n}",
            f"{run['steps']:,}",
            f"{run['episodes']:,}",
            f"{run['settled']:.0f} MB, {run['end']:.0f} MB",
            f"`{run['hash'][:16]}`",
            f"{run['seconds']:.0f} s",
        ]
        for n, run in enumerate(runs, 1)
    ]
    head = ["process", "steps", "episodes", "memory early on, at the end", "hash of what it gave out", "processor time"]
    return table(head, rows)


def kills_table(found: Mapping[str, Mapping[str, Any]]) -> str:
    """Write how often each task was killed."""
    rows = [
        [task.text, f"{found[name]['kills']}", f"{found[name]['finished']}", f"{found[name]['seconds']:.0f} s", "none"]
        for name, task in TASKS.items()
        if name in found
    ]
    head = ["task", "killed", "came to its end", "takes undisturbed", "lost, half or different"]
    return table(head, rows)
