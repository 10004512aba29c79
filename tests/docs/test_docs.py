"""The snippets in README and docs run as they stand: the README's each alone, a page's one after the other."""

import re
from pathlib import Path
from typing import Any

import pytest
from sybil import Sybil
from sybil.parsers.markdown import PythonCodeBlockParser

from flexarm_env.envs import batch
from scripts.docs import snippets
from scripts.docs.snippets import LONG

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
FOLDERS = ("docs", "docs/environments", "docs/how_to", "docs/reference", "docs/tutorials")
PAGES = [README, *(page for folder in FOLDERS for page in sorted((ROOT / folder).glob("*.md")))]


def page_case(page: Path) -> Any:
    """Make the page a test's parameter."""
    marks = [pytest.mark.slow] if page in LONG else []
    return pytest.param(page, marks=marks, id=str(page.relative_to(ROOT)))


@pytest.mark.parametrize("page", [page_case(page) for page in PAGES])
def test_snippets_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # snippets may write files
    monkeypatch.setattr(batch, "COSTS", {8: 1.0})  # however many environments: the blocks that other tests compile
    document = Sybil(parsers=[PythonCodeBlockParser()]).parse(page)
    examples = list(document.examples())
    assert len(examples) == page.read_text().count("```python"), "a snippet was not found"
    for example in examples:
        if page == README:
            document.namespace.clear()  # who copies one has nothing of the others
        example.evaluate()


def test_long_snippets_are_written_for_the_check_of_types(tmp_path: Path) -> None:
    """`make typecheck` reads the snippets that the fast tests do not run, all of them and in their order."""
    snippets.main(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {f"{page.stem}_snippets.py" for page in LONG}
    for page in LONG:
        written = (tmp_path / f"{page.stem}_snippets.py").read_text()
        document = Sybil(parsers=[PythonCodeBlockParser()]).parse(page)
        assert written == snippets.HEAD + "".join(str(example.parsed) for example in document.examples())


def test_a_snippet_that_is_not_found_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"has 2 snippets, of which 1 begin and end a line"):
        snippets.module("```python\na = 1\n```\n\n  ```python\n  b = 2\n  ```\n")


def test_pictures_and_links_exist() -> None:
    """Every relative link and picture of README and docs leads somewhere."""
    for page in [README, *(ROOT / "docs").rglob("*.md")]:
        for target in re.findall(r"\]\(([^)#:]+?)(?:#[^)]*)?\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name} links to {target}, which is not there"
