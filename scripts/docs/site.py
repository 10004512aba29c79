"""Build the site from the pages of this repository and the docstrings; without network, and a warning is an error.

The pages are laid out in a folder of their own, with the README as the first one, so that their relative links hold.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

from scripts.common.command_line import run
from scripts.common.markdown import DOCS
from scripts.docs.widgets import BOARD, STATIC, board_script, replay_names, with_widgets

ROOT = DOCS.parent
OUTPUT = ROOT / "build" / "site"
PAGES = ROOT / "build" / "site_pages"
FIRST = "index.md"  # the README's name on the site
TOP = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md", "CODE_OF_CONDUCT.md")
KINDS = ("md", "ipynb")  # of pages
LINK = re.compile(r"(?<=\]\()([^)#:\s]+)(?=[)#])")
BARE = re.compile(r"\[[\w./-]+\.md\](?=\([\w./-]+\.md[#)])")  # a page by its file's name: the site has titles

# The pages of docs by chapters; those that are not named come last.
CHAPTERS: Mapping[str, Sequence[str]] = {
    "Tutorials": (
        *("tutorials/first_agent", "tutorials/your_controller", "tutorials/late_sensor", "tutorials/sim_to_chain"),
        "notebooks/*",
    ),
    "Environments": ("environments/README", "environments/*", "metrics", "plant", "versioning"),
    "Control and learning": (
        "controllers",
        "lqg",
        "predictive",
        "optimal",
        "agents",
        "leaderboard",
        "replays",
        "submit",
    ),
    "Recipes": ("recipes/README", "recipes/*"),
    "Theory": ("model", "analysis", "derivatives"),
    "Evidence": ("validation", "reproduction", "claims", "reliability"),
}
MODULES = (
    "flexarm_env",
    "flexarm_env.actions",
    "flexarm_env.analysis",
    "flexarm_env.formulas",
    "flexarm_env.metrics",
    "flexarm_env.parameters",
    "flexarm_env.rollout",
    "flexarm_env.envs.single",
    "flexarm_env.envs.vector",
    "flexarm_baselines",
    "flexarm_baselines.controller",
    "flexarm_baselines.observers",
    "flexarm_baselines.optimal",
    "flexarm_baselines.registry",
    "flexarm_agents",
)


def chapters(docs: Path) -> dict[str, list[str]]:
    """Return the site's pages by chapters, without their endings.

    Args:
        docs: folder of the pages.
    """
    left = {page.relative_to(docs).with_suffix("").as_posix() for kind in KINDS for page in docs.rglob(f"*.{kind}")}
    found = {}
    for chapter, patterns in CHAPTERS.items():
        pages: list[str] = []
        for pattern in patterns:
            matches = sorted(page for page in left if Path(page).match(pattern))
            pages += matches
            left -= set(matches)
        found[chapter] = [f"docs/{page}" for page in pages]
    found["More"] = [f"docs/{page}" for page in sorted(left)] + [Path(name).stem for name in TOP[1:]]
    found["Reference"] = [f"api/{name}" for name in MODULES]
    return found


def toctree(caption: str, pages: Sequence[str]) -> str:
    """Write a chapter of the table of contents."""
    return "\n".join(("```{toctree}", ":hidden:", f":caption: {caption}", "", *pages, "```", ""))


def lay_out(pages: Path) -> None:
    """Write the site's sources.

    Args:
        pages: folder for them, which is made anew.
    """
    shutil.rmtree(pages, ignore_errors=True)
    shutil.copytree(DOCS, pages / "docs", ignore=shutil.ignore_patterns("__pycache__"))
    board = json.loads((DOCS / "leaderboard.json").read_text(encoding="utf-8"))
    (pages / STATIC / BOARD).write_text(board_script(board, replay_names()), encoding="utf-8")
    for name in TOP:
        shutil.copy(ROOT / name, pages / (FIRST if name == "README.md" else name))
    for page in pages.rglob("*.md"):
        text = with_widgets(with_links(page, pages), page.relative_to(pages))
        page.write_text(BARE.sub("[]", text), encoding="utf-8")
    with (pages / FIRST).open("a", encoding="utf-8") as file:
        file.writelines(f"\n{toctree(caption, names)}" for caption, names in chapters(DOCS).items())
    (pages / "api").mkdir()
    for name in MODULES:
        text = f"# {name}\n\n```{{eval-rst}}\n.. automodule:: {name}\n```\n"
        (pages / "api" / f"{name}.md").write_text(text, encoding="utf-8")


def with_links(page: Path, pages: Path) -> str:
    """Return a page's text whose links lead to where the site has them; other files of ours come along.

    Args:
        page: one of the pages that are laid out.
        pages: folder of them.
    """

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
