"""Tables as text for a terminal."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from itertools import zip_longest

_GAP = "  "


def columns(rows: Sequence[Sequence[str]], right: bool = False) -> str:
    """Write rows with their columns in line.

    Args:
        rows: all of one length; headers are rows like others.
        right: columns between the first and the last are figures, to stand at the right of their columns.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]

    def line(row: Sequence[str]) -> str:
        middle = (
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width in zip(row[1:-1], widths[1:-1], strict=True)
        )
        return _GAP.join((row[0].ljust(widths[0]), *middle, row[-1])).rstrip()

    return "\n".join(line(row) for row in rows)


def from_markdown(text: str, width: int) -> str:
    """Convert Markdown's prose and tables for a terminal.

    Args:
        text: paragraphs and tables, with code in backticks.
        width: width of a line.
    """
    blocks = [block for block in text.split("\n\n") if block.strip()]
    return "\n\n".join(_table(block, width) if block.startswith("|") else _prose(block, width) for block in blocks)


def _prose(text: str, width: int) -> str:
    text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", text).replace("`", "")
    return textwrap.fill(" ".join(text.split()), width, break_long_words=False, break_on_hyphens=False)


def _table(text: str, width: int) -> str:
    """Wrap the widest columns until the table fits; no column gets narrower than its longest word."""
    lines = [line for n, line in enumerate(text.splitlines()) if n != 1]  # without the rule under the header
    cells = [re.split(r"(?<!\\) \| ", line.removeprefix("| ").removesuffix(" |")) for line in lines]
    rows = [[cell.replace("\\|", "|").replace("`", "") for cell in row] for row in cells]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    room = width - len(_GAP) * (len(widths) - 1)
    longest = [
        max((len(word) for cell in column for word in cell.split()), default=1) for column in zip(*rows, strict=True)
    ]
    while sum(widths) > room and (wide := [n for n, width in enumerate(widths) if width > longest[n]]):
        widths[max(wide, key=widths.__getitem__)] -= 1
    wrapped: list[tuple[str, ...]] = []
    for row in rows:
        pieces = [
            textwrap.wrap(cell, size, break_long_words=False, break_on_hyphens=False)
            for cell, size in zip(row, widths, strict=True)
        ]
        wrapped += zip_longest(*pieces, fillvalue="")
    return columns(wrapped)
