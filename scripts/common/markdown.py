"""Markdown tables, and the blocks of docs/ that are generated from results."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"
_BLOCK = re.compile(r"(<!-- generated: (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Write a Markdown table, one line a row; pipes in cells are escaped."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


def filled(page: str, results: Path) -> str:
    """Replace every generated block of a page's text by the table of that name.

    Raises:
        FileNotFoundError: if the results lack a table.
    """
    return _BLOCK.sub(lambda block: block[1] + (results / f"{block[2]}.md").read_text() + block[3], page)
