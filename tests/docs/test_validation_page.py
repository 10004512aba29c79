"""docs/validation.md and the texts that quote it: the record, and what is made of a report."""

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from scripts.common.markdown import DOCS, quoting, shown_blocks, span
from scripts.docs import validation
from scripts.docs.validation import PAGES, QUOTING_PAGES
from tests.support.programs import ROOT, run_here

RECORD = json.loads((DOCS / "validation.json").read_text())


def test_the_pages_show_the_record() -> None:
    """`make docs` brings them up to date; what they do not show stands on the page of the whole record."""
    shown, tables = shown_blocks(), validation.tables_of(RECORD)
    assert {name: shown.get(name, text) for name, text in tables.items()} == tables
    assert tables.keys() - shown.keys() == validation.CAPTIONS.keys()
    whole = validation.page_of(RECORD)
    assert all(check["name"] in whole for check in RECORD["checks"])
    assert all(tables[name] in whole for name in validation.CAPTIONS)
    assert all(check["passed"] for check in RECORD["checks"])
    assert tuple(RECORD["groups"]) == tuple(validation.GROUPS)


def test_the_page_names_the_tests_of_each_group_and_every_picture_is_shown() -> None:
    modules = {path.stem for path in (ROOT / "tests" / "validation").rglob("test_*.py")}
    named = {*re.findall(r"`(test_\w+)`", (DOCS / "validation.md").read_text())}
    assert named == modules - {"test_tools"}  # of the checks' own tools
    pages = "".join((DOCS / name).read_text() for name in PAGES)
    shown = {*re.findall(r"\]\(figures/validation/(\w+\.png)\)", pages)}
    assert shown == {path.name for path in (DOCS / validation.PICTURES).iterdir()}


@pytest.mark.slow
def test_the_page_is_renewed_by_a_part_of_the_checks(tmp_path: Path) -> None:
    """The smallest group; its figures are those of the record, but for rounding."""
    report, docs = tmp_path / "results" / "report.xml", tmp_path / "docs"
    shutil.copytree(DOCS, docs)
    shutil.copyfile(ROOT / "README.md", tmp_path / "README.md")
    checks = ["tests/validation/test_links.py", "-m", "validation", f"--junitxml={report}"]
    done = subprocess.run([sys.executable, "-m", "pytest", *checks], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout
    assert "5 checks" in done.stdout
    status, _ = run_here("docs.validation", "--report", report, "--docs", docs)
    assert status, "a part is not the whole"
    status, said = run_here("docs.validation", "--report", report, "--docs", docs, "--part")
    assert not status, said
    assert "1 pictures" in said
    found = json.loads((docs / "validation.json").read_text())
    assert found["groups"] == RECORD["groups"]
    for new, old in zip(found["checks"], RECORD["checks"], strict=True):
        assert new == old | {"figure": pytest.approx(old["figure"], rel=0.02, abs=1e-10)}


@pytest.mark.parametrize("name", [*PAGES, *QUOTING_PAGES])
def test_a_page_quotes_the_record(name: str) -> None:
    """`make docs` brings it up to date."""
    page = (DOCS / name).read_text()
    assert "<!--=" in page
    assert page == quoting(page, validation.figures_of(RECORD))


def test_a_quoted_figure_is_written_anew() -> None:
    page = "It is <!--=x:.1f-->7<!--/--> m,\nor <!--=span([3, 1.25])-->1<!--/-->.\n"
    figures = {"x": 2.0, "span": span}
    assert quoting(page, figures) == page.replace("7", "2.0").replace("-->1<", "-->1.2 to 3.0<")
    with pytest.raises(NameError, match="x"):
        quoting(page, {"span": span})


def test_no_line_begins_with_a_quoted_figure() -> None:
    """Markdown would take the line as a block of HTML."""
    for page in (*DOCS.rglob("*.md"), ROOT / "README.md"):
        assert not re.search(r"^\s*(- )?<!--[=/]", page.read_text(), re.MULTILINE), page
