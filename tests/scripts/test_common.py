"""What the studies share: generated blocks of pages, and how errors are written."""

from pathlib import Path

import pytest

from flexarm_agents import Spread
from scripts.common import markdown
from scripts.common.markdown import fill_pages, filled, shown_blocks
from scripts.common.spreads import millimetres, spread_text


def test_errors_of_several_trainings() -> None:
    assert millimetres(Spread.of([0.1, None, 0.3])) == "300 / lost / lost"
    assert (millimetres(0.01234, 1), millimetres(None)) == ("12.3", "lost")
    assert spread_text(Spread.of([0.1]), 1) == "0.1"


def test_studies_fill_their_own_blocks(tmp_path: Path) -> None:
    page = "<!-- generated: mine -->\nold\n<!-- end -->\n<!-- generated: theirs -->\nold\n<!-- end -->\n"
    (tmp_path / "mine.md").write_text("new\n")
    assert filled(page, tmp_path, ["mine"]) == page.replace("old", "new", 1)
    with pytest.raises(FileNotFoundError):
        filled(page, tmp_path)


def test_blocks_are_filled_on_the_pages_that_have_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(markdown, "DOCS", tmp_path)
    (tmp_path / "mine.md").write_text("new\n")
    (tmp_path / "more").mkdir()
    page = tmp_path / "more" / "page.md"
    page.write_text("<!-- generated: mine -->\nold\n<!-- end -->\n")
    assert fill_pages(tmp_path, ["mine"]) == [page]
    assert shown_blocks() == {"mine": "new\n"}
    with pytest.raises(ValueError, match="generated block theirs"):
        fill_pages(tmp_path, ["mine", "theirs"])
