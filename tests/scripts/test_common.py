"""What the studies share: the command, generated blocks of pages, and how errors are written."""

import sys
from functools import partial
from pathlib import Path

import pytest
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from flexarm_agents import Spread
from scripts.common import markdown, study
from scripts.common.markdown import fill_pages, shown_blocks
from scripts.common.spreads import millimetres, spread_text
from scripts.common.study import Study, Trials, command


def test_errors_of_several_trainings() -> None:
    assert millimetres(Spread.of([0.1, None, 0.3])) == "300 / lost / lost"
    assert (millimetres(0.01234, 1), millimetres(None)) == ("12.3", "lost")
    assert spread_text(Spread.of([0.1]), 1) == "0.1"


def test_blocks_are_filled_on_the_pages_that_have_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(markdown, "DOCS", tmp_path)
    page, other = tmp_path / "more" / "page.md", tmp_path / "other.md"
    page.parent.mkdir()
    other.write_text("text")
    page.write_text("a\n<!-- generated: mine -->\nold\n<!-- end -->\n<!-- generated: theirs -->\nold\n<!-- end -->\n")
    assert fill_pages({"mine": "new\n"}) == [page]
    assert shown_blocks() == {"mine": "new\n", "theirs": "old\n"}
    with pytest.raises(ValueError, match="generated block none"):
        fill_pages({"mine": "newer\n", "none": ""})
    assert shown_blocks()["mine"] == "new\n"


def parabola(results: dict[str, float]) -> Figure:
    figure, axis = plt.subplots()
    axis.plot(list(results.values()))
    return figure


@pytest.mark.parametrize("svg", [False, True])
def test_a_study_shows_its_results_in_docs(svg: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    docs, output = tmp_path / "docs", tmp_path / "results"
    docs.mkdir()
    (docs / "page.md").write_text("<!-- generated: squares -->\nold\n<!-- end -->\n")
    monkeypatch.setattr(markdown, "DOCS", docs)
    monkeypatch.setattr(study, "DOCS", docs)
    monkeypatch.setattr(sys, "argv", ["", "--output", str(output), "--only", "squares", "--docs"])
    trials = Trials("scripts.common.study", lambda: {str(n): partial(pow, n, 2) for n in (2, 3)})
    squares = Study("squares", trials, {"squares": lambda found: f"{found}\n"}, {"sub/squares": parabola}, svg)
    command("mine", {"squares": squares, "others": squares}, "Square numbers.")
    assert shown_blocks() == {"squares": "{'2': 4, '3': 9}\n"}
    picture = output / "figures" / "sub" / "squares.png"
    assert (docs / "figures" / "sub" / "squares.png").read_bytes() == picture.read_bytes()
    assert picture.with_suffix(".svg").is_file() == svg
