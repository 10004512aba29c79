"""Markdown tables, errors in them, and the blocks of docs/ that are generated from results.

A *generated* block is a table or a paragraph that a study writes, from a marker with its name to the next
`<!-- end -->`. A *quoted* figure stands in the text behind the expression that gives it, as an f-string's field:
`<!--=expression-->figure<!--/-->`. No line begins with one, or Markdown would take that line as HTML.
"""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from flexarm_agents import Spread
from flexarm_agents.board.tables import table as table
from flexarm_agents.files import write_text

DOCS = Path(__file__).resolve().parents[2] / "docs"
_BLOCK = re.compile(r"(<!-- generated: (\w+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
_QUOTED = re.compile(r"(<!--=(.*?)-->).*?(?=<!--/-->)", re.DOTALL)


def filled(page: str, tables: Mapping[str, str]) -> str:
    """Replace generated blocks of a page's text by the tables of their names; the other blocks stay."""
    return _BLOCK.sub(lambda block: f"{block[1]}{tables.get(block[2], block[3])}{block[4]}", page)


def kept_tables(folder: Path) -> dict[str, str]:
    """Return the tables that a study left in a folder, by their names."""
    return {path.stem: path.read_text() for path in folder.glob("*.md")}


def blocks(page: str) -> dict[str, str]:
    """Return the generated blocks of a page's text, by their names."""
    return {block[2]: block[3] for block in _BLOCK.finditer(page)}


def shown_blocks() -> dict[str, str]:
    """Return the generated blocks of all pages of docs/, by their names."""
    return {name: text for path in DOCS.rglob("*.md") for name, text in blocks(path.read_text()).items()}


def fill_pages(tables: Mapping[str, str]) -> list[Path]:
    """Replace generated blocks wherever they stand in docs/, and return the pages.

    Raises:
        ValueError: if a block stands on no page.
    """
    pages = {path: path.read_text() for path in sorted(DOCS.rglob("*.md"))}
    found = [path for path, text in pages.items() if tables.keys() & blocks(text).keys()]
    missing = tables.keys() - {name for path in found for name in blocks(pages[path])}
    if missing:
        raise ValueError(f"docs: no page has the generated block {', '.join(sorted(missing))}")
    for path in found:
        write_text(path, filled(pages[path], tables))
    return found


def quoting(page: str, figures: Mapping[str, Any]) -> str:
    """Write every quoted figure of a page anew.

    Raises:
        KeyError, NameError: if the figures lack one that the page quotes.
    """
    return _QUOTED.sub(lambda one: one[1] + eval(f'f"""{{{one[2]}}}"""', dict(figures)), page)


def span(values: Iterable[float], digits: int = 1) -> str:
    """Write the least and the largest of some values: "5.2 to 5.4"."""
    found = list(values)
    return f"{min(found):.{digits}f} to {max(found):.{digits}f}"


def spread_text(spread: Spread, digits: int = 3, scale: float = 1.0) -> str:
    """Write median, interquartile mean and worst of several trainings, scaled; one figure where there is one."""
    values = (spread.median, spread.interquartile_mean, spread.worst)[: 3 if spread.total > 1 else 1]
    return " / ".join("lost" if value is None else f"{scale * value:.{digits}f}" for value in values)


def millimetres(error: Spread | float | None, digits: int = 0) -> str:
    """Write an error [m] of one lap or of several trainings in mm, "lost" where there is none."""
    return spread_text(error if isinstance(error, Spread) else Spread.of([error]), digits, 1e3)
