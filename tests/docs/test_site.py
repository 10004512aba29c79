"""The site: every page has its place; the page of the commands is what the parsers say."""

import re
from pathlib import Path

import pytest

from flexarm_agents.commands import VERBS
from scripts.common.markdown import shown_blocks
from scripts.docs import commands, site
from scripts.docs.contents import CHAPTERS, KINDS, contents, first_sentence
from tests.support.programs import ROOT

PAGES = [
    path.relative_to(ROOT).with_suffix("").as_posix() for kind in KINDS for path in (ROOT / "docs").rglob(f"*.{kind}")
]


@pytest.fixture(scope="module")
def laid_out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("site") / "pages"
    site.lay_out(folder)
    return folder


def test_every_page_stands_once_in_the_contents(laid_out: Path) -> None:
    files = [path.relative_to(laid_out) for kind in KINDS for path in laid_out.rglob(f"*.{kind}")]
    pages = {path.with_suffix("").as_posix() for path in files}
    text = "".join(page.read_text() for page in laid_out.rglob("*.md"))
    trees = re.findall(r"```{toctree}\n:hidden:\n\n(.*?)\n```", text, re.DOTALL)
    listed = [re.sub(r"^.* <|>$", "", line).removeprefix("/") for tree in trees for line in tree.splitlines()]
    assert sorted(listed) == sorted(pages - {"index"})
    assert set(PAGES) <= pages


def test_the_first_level_of_the_contents_is_short() -> None:
    assert max(len(CHAPTERS), *(len(chapter.pages) for chapter in CHAPTERS.values())) <= 12  # that a reader takes in


def test_pages_that_no_chapter_names_come_last_and_chapters_without_pages_are_left_out() -> None:
    assert contents(["docs/concepts", "docs/other", "api/index", "api/flexarm_env"]) == {
        "api/index": ["api/flexarm_env"],
        "start": ["docs/concepts"],
        "reference": ["api/index"],
        "developers": ["docs/other"],
    }


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("<!-- made -->\n\n# Title\n\nA [link](a.md#b) of 3.5 m. More.", "A link of 3.5 m."),
        ("# Title\n\n```python\na = 1\n\nb = 2\n```\n\nThe law ([model.md](model.md)) holds:\n\n- x", "The law holds"),
        ("# Title\n\n| a |\n|---|\n\n`make` does it! *So* there.", "`make` does it!"),
        ("# Title", ""),
    ],
)
def test_a_page_without_a_line_shows_its_first_sentence(text: str, sentence: str) -> None:
    assert first_sentence(text) == sentence


def test_links_and_pictures_lead_to_files_also_outside_docs(laid_out: Path) -> None:
    contributing = (laid_out / "CONTRIBUTING.md").read_text(encoding="utf-8")
    assert "](index.md)" in contributing
    assert "](README.md)" not in contributing
    for page in laid_out.rglob("*.md"):
        for target in site.LINK.findall(page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page}: {target}"


def test_the_page_is_what_the_parsers_say() -> None:
    shown = shown_blocks()["command_line"]
    assert shown == commands.text(), "run python -m scripts.docs.commands"
    assert all(f"## `flexarm {verb}`\n" in shown for verb in VERBS)
