"""Texts that quote figures are what the generator writes from the committed records."""

from __future__ import annotations

import json

import pytest

from scripts.common.markdown import DOCS, quoting, span
from scripts.docs.quoted import of_validation
from scripts.docs.validation import PAGES, QUOTING_PAGES

RECORD = json.loads((DOCS / "validation.json").read_text())


@pytest.mark.parametrize("name", [*PAGES, *QUOTING_PAGES])
def test_a_page_quotes_the_record(name: str) -> None:
    """`make docs` brings it up to date."""
    page = (DOCS / name).read_text()
    assert "<!-- quoting:" in page
    assert page == quoting(page, of_validation(RECORD))


def test_a_quoting_block_is_written_anew() -> None:
    page = "a\n<!-- quoting:\nIt is {x:.1f} m, {span([3, 1.25])}.\n-->\nIt is 7 m.\n<!-- end -->\nb\n"
    figures = {"x": 2.0, "span": span}
    assert quoting(page, figures) == page.replace("It is 7 m.", "It is 2.0 m, 1.2 to 3.0.")
    with pytest.raises(NameError, match="x"):
        quoting(page, {"span": span})
