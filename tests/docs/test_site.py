"""The site: every page has its place, and what is built has no dead link."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

from scripts.docs import site
from tests.support.programs import ROOT

PAGES = [
    path.relative_to(ROOT).with_suffix("").as_posix()
    for kind in ("md", "ipynb")
    for path in (ROOT / "docs").rglob(f"*.{kind}")
]


def test_every_page_stands_once_in_the_contents() -> None:
    listed = [page for pages in site.chapters(ROOT / "docs").values() for page in pages]
    assert len(set(listed)) == len(listed)
    assert {page for page in listed if page.startswith("docs/")} == set(PAGES)


@pytest.mark.parametrize("name", site.MODULES)
def test_the_reference_is_of_modules_with_public_names(name: str) -> None:
    module = importlib.import_module(name)
    assert module.__doc__


def test_links_to_files_outside_docs_are_kept(tmp_path: Path) -> None:
    site.lay_out(tmp_path / "pages")
    contributing = (tmp_path / "pages/CONTRIBUTING.md").read_text(encoding="utf-8")
    assert "](index.md)" in contributing
    assert "](README.md)" not in contributing
    for page in (tmp_path / "pages").rglob("*.md"):
        for target in site.LINK.findall(page.read_text(encoding="utf-8")):
            assert (page.parent / target).exists(), f"{page}: {target}"
