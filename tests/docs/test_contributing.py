"""CONTRIBUTING.md: its walk names lines of code; its recipes are diffs that apply here and pass their checks."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).resolve().parents[2]
SCREEN, WALK = 60, 40  # lines


class Recipe(NamedTuple):
    """A section of the page: its title, its diff and its check."""

    title: str
    diff: str
    check: str


def recipes() -> list[Recipe]:
    section = (ROOT / "CONTRIBUTING.md").read_text().split("\n## Recipes\n")[1].split("\n## ")[0]
    found = []
    for text in section.split("\n### ")[1:]:
        blocks = {language: re.findall(rf"```{language}\n(.*?)```", text, re.DOTALL) for language in ("diff", "python")}
        assert {language: len(each) for language, each in blocks.items()} == {"diff": 1, "python": 1}, text
        found.append(Recipe(text.splitlines()[0], blocks["diff"][0], blocks["python"][0]))
    return found


def apply(diff: str, folder: Path) -> None:
    """Apply a unified diff as `git apply` does, but only where each hunk fits in exactly one place."""
    for change in re.split(r"^diff --git .*\n", diff, flags=re.MULTILINE)[1:]:
        header, *hunks = re.split(r"^(?=@@)", change, flags=re.MULTILINE)
        names = re.fullmatch(r"--- a/(.*)\n\+\+\+ b/(.*)\n", header)
        assert names, header
        assert names[1] == names[2]
        path = folder / names[1]
        text = path.read_text()
        for hunk in hunks:
            place, *lines = hunk.splitlines(keepends=True)
            old, new = ("".join(line[1:] for line in lines if line[0] in kept) for kept in (" -", " +"))
            counts = re.match(r"@@ -\d+(?:,(\d+))? \+\d+(?:,(\d+))? @@", place)
            assert counts, place
            assert [int(count or 1) for count in counts.groups()] == [old.count("\n"), new.count("\n")], place
            assert text.count(old) == 1, f"{path.name}: {place}fits in {text.count(old)} places"
            text = text.replace(old, new)
        path.write_text(text)


def test_each_line_of_the_walk_is_in_its_file() -> None:
    section = (ROOT / "CONTRIBUTING.md").read_text().split("\n### A walk\n")[1].split("\n## ")[0]
    lines = re.findall(r"^\| `(.+?)` \| `(.+?)` \|", section, re.MULTILINE)
    assert len(section.splitlines()) <= WALK
    assert len(lines) > 10
    for code, file in lines:
        assert code in (ROOT / "flexarm_env" / file).read_text(), f"{file} no longer holds {code!r}"


@pytest.mark.parametrize("recipe", recipes(), ids=lambda recipe: recipe.title)
def test_a_recipe_works(recipe: Recipe, tmp_path: Path) -> None:
    without = shutil.ignore_patterns("__pycache__")
    for folder in ("flexarm_env", "tests/support"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=without)
    shutil.copy(ROOT / "tests/__init__.py", tmp_path / "tests")
    apply(recipe.diff, tmp_path)
    compiled_nothing = "\nfrom flexarm_env.codegen import compiler\nassert not compiler.load.cache_info().currsize\n"
    ours = f"\nimport flexarm_env\nassert flexarm_env.__file__.startswith({str(tmp_path)!r})\n"
    done = subprocess.run(
        [sys.executable, "-c", recipe.check + compiled_nothing + ours],
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr


def test_a_recipe_fits_on_a_screen() -> None:
    assert recipes()
    for recipe in recipes():
        assert len(recipe.diff.splitlines()) <= SCREEN, recipe.title


def test_a_diff_that_does_not_fit_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file.py").write_text("a\nb\na\nb\n")
    diff = "diff --git a/file.py b/file.py\n--- a/file.py\n+++ b/file.py\n@@ -1,2 +1,2 @@\n a\n-b\n+c\n"
    with pytest.raises(AssertionError, match="fits in 2 places"):
        apply(diff, tmp_path)
    with pytest.raises(AssertionError, match="fits in 0 places"):
        apply(diff.replace("-b", "-d"), tmp_path)
    (tmp_path / "file.py").write_text("0\na\nb\n")
    apply(diff, tmp_path)
    assert (tmp_path / "file.py").read_text() == "0\na\nc\n"
