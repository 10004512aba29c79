"""Texts that quote figures are what the generator writes from the committed records; and what they say in words."""

from __future__ import annotations

import json

import pytest

from scripts.common.markdown import DOCS, quoting, span
from scripts.docs.quoted import of_validation
from scripts.docs.validation import PAGES, QUOTING_PAGES

RECORD = json.loads((DOCS / "validation.json").read_text())
PROGRAMMES = ("doublet", "bang_bang", "multi_sine", "spin_up", "release", "payload")


@pytest.fixture(scope="module")
def engine() -> dict[str, float]:
    """Return the figures of the comparison with MuJoCo."""
    return dict(RECORD["groups"]["engine"]["quoted"])


@pytest.mark.parametrize("name", [*PAGES, *QUOTING_PAGES])
def test_a_page_quotes_the_record(name: str) -> None:
    """`make docs` brings it up to date."""
    page = (DOCS / name).read_text()
    assert "<!-- quoting:" in page
    assert page == quoting(page, of_validation(RECORD))


def test_what_the_texts_say_beside_the_figures(engine: dict[str, float]) -> None:
    """README: the checks pass. docs/model.md: the reference alone leaves the linear arm's range."""
    assert RECORD["passed"]
    assert engine["reference, largest"] > float(of_validation(RECORD)["spin"]("bent by 5 %, 10 mm"))


def test_a_quoting_block_is_written_anew() -> None:
    page = "a\n<!-- quoting:\nIt is {x:.1f} m, {span([3, 1.25])}.\n-->\nIt is 7 m.\n<!-- end -->\nb\n"
    figures = {"x": 2.0, "span": span}
    assert quoting(page, figures) == page.replace("It is 7 m.", "It is 2.0 m, 1.2 to 3.0.")
    with pytest.raises(NameError, match="x"):
        quoting(page, {"span": span})


def test_how_many_programmes_are_within_a_millimetre(engine: dict[str, float]) -> None:
    """Three of six with 3 modes and foreshortening, four with four polynomials."""
    for model, count in (("3 modes", 3), ("4 polynomials", 4)):
        assert sum(engine[f"{name}, foreshortened, {model}, rms"] < 1.0 for name in PROGRAMMES) == count


def test_what_the_validity_table_says_in_words(engine: dict[str, float]) -> None:
    two, three = "foreshortened, 2 modes", "foreshortened, 3 modes"
    assert f"limit, {two}, smooth torques, 10 mm" not in engine, "within it all over the range"
    assert f"limit, {three}, torques that jump, 50 mm" not in engine
    for model in (two, three):
        assert all(engine[f"spin, {model}, {bend}, 10 mm"] == 1.0 for bend in ("hardly bent", "bent by 5 %"))
        assert f"spin, {model}, unstable from" not in engine, "stable up to 10"
