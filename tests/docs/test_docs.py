"""The snippets in README and docs run as they stand: the README's each alone, a page's one after the other."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from sybil import Sybil
from sybil.parsers.markdown import PythonCodeBlockParser

from flexarm_env.envs import batch

ROOT = Path(__file__).resolve().parents[2]
README = ROOT / "README.md"
FOLDERS = ("docs", "docs/environments", "docs/tutorials")
PAGES = [README, *(page for folder in FOLDERS for page in sorted((ROOT / folder).glob("*.md")))]
LONG = {ROOT / f"docs/{name}.md" for name in ("derivatives", "optimal")}  # whose kernels other tests do not compile


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


# The snippets' own functions have no annotations, and torch's tensors stand for sequences.
CHECKED = '# mypy: allow-untyped-defs, allow-untyped-calls, disable-error-code="arg-type"\n'


def test_long_snippets_agree_with_the_types(tmp_path: Path) -> None:
    """The snippets that the fast tests do not run: what they import, and the names and arguments that they use."""
    types = ROOT / "build" / "types"  # as `make typecheck`
    types.mkdir(parents=True, exist_ok=True)
    for folder in ("baselines", "agents"):
        if not (types / f"flexarm_{folder}").exists():
            (types / f"flexarm_{folder}").symlink_to(ROOT / folder)
    files = []
    for page in sorted(LONG):
        snippets = re.findall(r"^```python\n(.*?)^```", page.read_text(), re.DOTALL | re.MULTILINE)
        assert len(snippets) == page.read_text().count("```python")
        files.append(tmp_path / f"{page.stem}_snippets.py")
        files[-1].write_text(CHECKED + "".join(snippets))
    command = [sys.executable, "-m", "mypy", *map(str, files), "docs/recipes/cleanrl_ppo.py"]
    checked = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert checked.returncode == 0, checked.stdout + checked.stderr


def test_pictures_and_links_exist() -> None:
    """Every relative link and picture of README and docs leads somewhere."""
    for page in [README, *(ROOT / "docs").rglob("*.md")]:
        for target in re.findall(r"\]\(([^)#:]+?)(?:#[^)]*)?\)", page.read_text()):
            assert (page.parent / target).exists(), f"{page.name} links to {target}, which is not there"
