"""CONTRIBUTING.md: its walk names lines of code; its recipes are diffs that apply here and pass their checks."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.programs import ROOT, run_bare

SCREEN, WALK = 60, 40  # lines


def recipes() -> dict[str, tuple[str, str]]:
    """Return the diff and the check of each recipe, by its title."""
    section = (ROOT / "CONTRIBUTING.md").read_text().split("\n## Recipes\n")[1].split("\n## ")[0]
    found = {}
    for text in section.split("\n### ")[1:]:
        (diff,), (check,) = (re.findall(rf"```{kind}\n(.*?)```", text, re.DOTALL) for kind in ("diff", "python"))
        found[text.splitlines()[0]] = diff, check
    return found


def apply(diff: str, folder: Path) -> None:
    """Apply a diff where each hunk fits in exactly one place, as `git apply` does not demand."""
    for change in re.split(r"^diff --git .*\n", diff, flags=re.MULTILINE)[1:]:
        header, *hunks = re.split(r"^@@.*\n", change, flags=re.MULTILINE)
        path = folder / header.splitlines()[1].removeprefix("+++ b/")
        for old in (re.sub(r"^\+.*\n|^.", "", hunk, flags=re.MULTILINE) for hunk in hunks):
            places = path.read_text().count(old)
            assert places == 1, f"{path.name}: a hunk fits in {places} places"
    subprocess.run(["git", "apply"], input=diff, text=True, cwd=folder, check=True)


def test_each_line_of_the_walk_is_in_its_file() -> None:
    section = (ROOT / "CONTRIBUTING.md").read_text().split("\n### A walk\n")[1].split("\n## ")[0]
    lines = re.findall(r"^\| `(.+?)` \| `(.+?)` \|", section, re.MULTILINE)
    assert len(section.splitlines()) <= WALK
    assert len(lines) > 10
    for code, file in lines:
        assert code in (ROOT / "flexarm_env" / file).read_text(), f"{file} no longer holds {code!r}"


@pytest.mark.parametrize(("diff", "check"), recipes().values(), ids=recipes())
def test_a_recipe_works(diff: str, check: str, tmp_path: Path) -> None:
    assert len(diff.splitlines()) <= SCREEN
    without = shutil.ignore_patterns("__pycache__")
    for folder in ("flexarm_env", "tests/support"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=without)
    shutil.copy(ROOT / "tests/__init__.py", tmp_path / "tests")
    apply(diff, tmp_path)
    compiled_nothing = "\nfrom flexarm_env.codegen import compiler\nassert not compiler.load.cache_info().currsize\n"
    ours = f"\nimport flexarm_env\nassert flexarm_env.__file__.startswith({str(tmp_path)!r})\n"
    code = check + compiled_nothing + ours
    done = run_bare(sys.executable, "-c", code, cwd=tmp_path, PYTHONPATH=str(tmp_path))
    assert done.returncode == 0, done.stderr
