"""Build the site from the pages of this repository and the docstrings; without network, and a warning is an error.

The pages are laid out in a folder of their own, with the README as the first one, so that their relative links hold.
"""

import json
import re
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

from flexarm_agents.board.measure import PUBLISHED, as_csv
from scripts.common.command_line import run
from scripts.common.markdown import DOCS
from scripts.docs import validation, widgets
from scripts.docs.contents import CHAPTERS, KINDS, MODULES, chapter_page, contents, listing, toctree

ROOT = DOCS.parent
OUTPUT = ROOT / "build" / "site"
PAGES = ROOT / "build" / "site_pages"
FIRST = "index.md"  # the README's name on the site
TOP = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md", "CODE_OF_CONDUCT.md")
LINK = re.compile(r"(?<=\]\()([^)#:\s]+)(?=[)#])")
MOVING = re.compile(r"^!\[.*\.webp\)$", re.MULTILINE)  # the README's first such picture: the viewer takes its place
BARE = re.compile(r"\[[\w./-]+\.md\](?=\([\w./-]+\.md[#)])")  # a page by its file's name: the site has titles


def lay_out(pages: Path) -> None:
    """Write the site's sources."""
    shutil.rmtree(pages, ignore_errors=True)
    shutil.copytree(DOCS, pages / "docs", ignore=shutil.ignore_patterns("__pycache__"))
    board = json.loads(PUBLISHED.read_text(encoding="utf-8"))
    shown = widgets.board_script(board, widgets.replay_names()), as_csv(board), json.dumps(board)
    for name, text in zip((widgets.BOARD, *widgets.BOARD_DATA), shown, strict=True):
        (pages / widgets.STATIC / name).write_text(text, encoding="utf-8")
    record = json.loads((DOCS / validation.RECORD).read_text(encoding="utf-8"))
    (pages / "docs" / validation.ALL).write_text(validation.page_of(record), encoding="utf-8")
    for name in TOP:
        shutil.copy(ROOT / name, pages / (FIRST if name == "README.md" else name))
    for page in pages.rglob("*.md"):
        text = with_links(page, pages)
        if page == pages / FIRST:
            text = MOVING.sub(r"<!-- site: lap -->\n\g<0>\n<!-- site end -->", text, count=1)
        text = widgets.with_widgets(text, page.relative_to(pages))
        if page.relative_to(pages).as_posix() == widgets.FOLDED:
            text = widgets.with_folds(text)
        page.write_text(BARE.sub("[]", text), encoding="utf-8")
    write_reference(pages / "api")
    write_contents(pages)


def write_reference(folder: Path) -> None:
    """Write a page for each module of the reference, and one that lists them."""
    folder.mkdir()
    for name in MODULES:
        text = f"# {name}\n\n```{{eval-rst}}\n.. automodule:: {name}\n```\n"
        (folder / f"{name}.md").write_text(text, encoding="utf-8")
    lines = {f"[{name}]({name}.md)": (import_module(name).__doc__ or "").partition("\n")[0] for name in MODULES}
    first = "The public modules of FlexArm, its baselines and its agents; {ref}`all their names <genindex>`."
    text = listing("Python API", first, lines)
    (folder / "index.md").write_text(text, encoding="utf-8")


def write_contents(pages: Path) -> None:
    """Write the chapters' pages, and what stands below each page."""
    files = [page for kind in KINDS for page in pages.rglob(f"*.{kind}") if page != pages / FIRST]
    below = contents(page.relative_to(pages).with_suffix("").as_posix() for page in files)
    for name, children in below.items():
        if name in CHAPTERS:
            (pages / f"{name}.md").write_text(chapter_page(CHAPTERS[name], children, pages), encoding="utf-8")
        else:
            append(pages / f"{name}.md", toctree(children, pages))
    append(pages / FIRST, toctree([name for name in CHAPTERS if name in below], pages))


def append(page: Path, text: str) -> None:
    """Write text at the end of a page."""
    with page.open("a", encoding="utf-8") as file:
        file.write(text)


def with_links(page: Path, pages: Path) -> str:
    """Return a page's text whose links lead to where the site has them; other files of ours come along."""

    def link(match: re.Match[str]) -> str:
        """Return where a link leads on the site."""
        target = (page.parent / match[0]).resolve()
        if target == pages.resolve() / "README.md":
            return match[0].replace("README.md", FIRST)
        own = ROOT / target.relative_to(pages.resolve()) if target.is_relative_to(pages.resolve()) else target
        if own.is_file() and not target.exists():
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(own, target)
        return match[0]

    return LINK.sub(link, page.read_text(encoding="utf-8"))


def main() -> None:
    """Lay out the pages and run Sphinx."""
    lay_out(PAGES)
    shutil.rmtree(OUTPUT, ignore_errors=True)  # pages of an earlier build would stay
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-b", "html", "-c", str(PAGES / "docs")]
    quiet = [] if sys.stdout.isatty() else ["-q"]  # in a terminal Sphinx tells how far it is
    ended = subprocess.run([*command, *quiet, str(PAGES), str(OUTPUT)], cwd=ROOT, check=False)
    if ended.returncode != 0:
        raise ValueError("site: Sphinx found the faults above")
    print(f"{OUTPUT / 'index.html'}: written")


if __name__ == "__main__":
    run(main)
