"""Tables as text for a terminal."""

import re
import textwrap
from collections.abc import Sequence
from itertools import pairwise, zip_longest

_GAP = "  "


def columns(rows: Sequence[Sequence[str]], right: bool = False) -> str:
    """Write rows with their columns in line."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]

    def line(row: Sequence[str]) -> str:
        middle = (
            cell.rjust(width) if right else cell.ljust(width)
            for cell, width in zip(row[1:-1], widths[1:-1], strict=True)
        )
        return _GAP.join((row[0].ljust(widths[0]), *middle, row[-1])).rstrip()

    return "\n".join(line(row) for row in rows)


def from_markdown(text: str, width: int) -> str:
    """Convert Markdown's prose and tables for a terminal."""
    blocks = [block for block in re.split(r"\n\n|\n(?=- )", text) if block.strip()]
    parts = [_table(block, width) if block.startswith("|") else _prose(block, width) for block in blocks]
    gaps = ["\n" if one.startswith("- ") and other.startswith("- ") else "\n\n" for one, other in pairwise(blocks)]
    return "".join(part for pair in zip_longest(parts, gaps, fillvalue="") for part in pair)


def _prose(text: str, width: int) -> str:
    text = _plain(text)
    return _filled(text, width, "  " if text.startswith("- ") else "")


def _plain(text: str) -> str:
    """Return a text without Markdown's links, emphasis, code marks and escapes."""
    text = re.sub(r"\[([^]]*)\]\([^)]*\)", r"\1", text)
    text = re.sub(r"(?<![\w\\])\*(\w[^*]*)\*", r"\1", text).replace("`", "")
    return re.sub(r"\\([*|])", r"\1", text)


def _filled(text: str, width: int, indent: str, first: str = "") -> str:
    return textwrap.fill(
        " ".join(text.split()),
        width,
        initial_indent=first,
        subsequent_indent=indent,
        break_long_words=False,
        break_on_hyphens=False,
    )


def _table(text: str, width: int) -> str:
    """Write a table with its columns in line; as a list if the last one has most of the text and no room for it."""
    lines = [line for n, line in enumerate(text.splitlines()) if n != 1]  # without the rule under the header
    cells = [re.split(r"(?<!\\) \| ", line.removeprefix("| ").removesuffix(" |")) for line in lines]
    rows = [[_plain(cell) for cell in row] for row in cells]
    widths = _widths(rows, width)
    texts = ["".join(column) for column in zip(*rows, strict=True)]
    longest = max(len(row[-1]) for row in rows)
    if len(texts) > 2 and len(texts[-1]) == max(map(len, texts)) and widths[-1] < min(width // 3, longest):
        return _list(rows, width)
    wrapped: list[tuple[str, ...]] = []
    for row in rows:
        pieces = [
            textwrap.wrap(cell, size, break_long_words=False, break_on_hyphens=False)
            for cell, size in zip(row, widths, strict=True)
        ]
        wrapped += zip_longest(*pieces, fillvalue="")
    return columns(wrapped)


def _widths(rows: Sequence[Sequence[str]], width: int) -> list[int]:
    """Narrow the widest columns until the table fits: those with a long head first, then all.

    No column gets narrower than its longest word.
    """
    table = list(zip(*rows, strict=True))
    widths = [max(map(len, column)) for column in table]
    room = width - len(_GAP) * (len(widths) - 1)
    words = [max((len(word) for cell in column for word in cell.split()), default=1) for column in table]
    bodies = [max([word, *map(len, column[1:])]) for word, column in zip(words, table, strict=True)]
    for least in (bodies, words):
        while sum(widths) > room and (wide := [n for n, width in enumerate(widths) if width > least[n]]):
            widths[max(wide, key=widths.__getitem__)] -= 1
    return widths


def _list(rows: Sequence[Sequence[str]], width: int) -> str:
    """Write each row as its first cell with the cells between by their headers, and the last cell below."""
    (_, *between, _), *body = rows
    entries = []
    for name, *cells, what in body:
        given = "; ".join(f"{header} {cell}" for header, cell in zip(between, cells, strict=True) if cell)
        entries += [_filled(f"{name}: {given}", width, "    "), _filled(what, width, "    ", "    ")]
    return "\n".join(entries)
