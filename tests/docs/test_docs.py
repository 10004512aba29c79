"""What README, docs, docstrings and notebooks show runs as it stands and prints what they say; links lead somewhere."""

import doctest
import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

from flexarm_env.envs import batch
from scripts.docs import snippets
from scripts.docs.contents import MODULES
from scripts.docs.notebooks import FOLDER, executed
from scripts.docs.snippets import LONG
from scripts.docs.steps import LOOSE, PICTURE, TOLERANCE, TRAINS, TUTORIALS, agree, excerpt, printed, steps
from tests.support.programs import PACKAGES, ROOT

README = ROOT / "README.md"
FOLDERS = ("docs", "docs/environments", "docs/how_to", "docs/reference", "docs/tutorials")
PAGES = [README, *(page for folder in FOLDERS for page in sorted((ROOT / folder).glob("*.md")))]
MOST_BYTES = 60_000  # of a tutorial's picture


@pytest.mark.parametrize(
    "page", [pytest.param(p, marks=[pytest.mark.slow] * (p in LONG), id=str(p.relative_to(ROOT))) for p in PAGES]
)
def test_steps_run(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The README's each alone, a page's one after the other."""
    monkeypatch.chdir(tmp_path)  # steps may write files
    monkeypatch.setattr(sys, "path", sys.path[:])  # modules of the reader are found in this folder
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    monkeypatch.setattr(batch, "COSTS", {8: 1.0})  # however many environments: the blocks that other tests compile
    text, tolerance = page.read_text(encoding="utf-8"), TOLERANCE
    names: dict[str, Any] = {}
    for step in steps(text):
        if not step.runs:
            continue
        if page == README:
            names.clear()  # who copies one has nothing of the others
        output = printed(step, names, str(page))
        tolerance = LOOSE if step.code.startswith(TRAINS) else tolerance
        if step.shown is not None:
            found = excerpt(step.shown, output)
            assert agree(step.shown, found, tolerance), f"{page.name}, line {step.line}, prints\n{found}"
    for picture in PICTURE.findall(text):
        assert list(tmp_path.rglob(Path(picture).name)), f"no step draws {picture}"


def test_tutorials_show_outputs_and_small_pictures() -> None:
    for page in TUTORIALS.values():
        text = page.read_text(encoding="utf-8")
        assert any(step.shown for step in steps(text)), page
        pictures = PICTURE.findall(text)
        assert pictures, page
        assert [one for one in pictures if (ROOT / "docs" / one).stat().st_size > MOST_BYTES] == []


@pytest.mark.parametrize(
    ("shown", "found", "same"),
    [
        ("error 0.052 m", "error  0.053 m", True),  # rounding
        ("error 0.052 m", "error 0.060 m", False),
        ("error 702 mm", "error 710 mm", True),
        ("lost after 3 s", "done after 3 s", False),
        ("1 2", "1 2 3", False),
    ],
)
def test_outputs_agree_but_for_little(shown: str, found: str, same: bool) -> None:
    assert agree(shown, found) is same


def test_a_snippet_that_is_read_from_a_file_is_written_to_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    found = steps("```python\n# mine.py\na = 1\n```\n\n```python\n# mine.py\nb = a + 1\n```\n")
    assert [step.line for step in found] == [2, 7]
    for step in found:
        printed(step, {"a": 1}, "page")
    assert (tmp_path / "mine.py").read_text() == "# mine.py\na = 1\n# mine.py\nb = a + 1\n"


def test_long_snippets_are_written_for_the_check_of_types(tmp_path: Path) -> None:
    """`make typecheck` reads the snippets that the fast tests do not run, all of them and in their order."""
    snippets.main(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {f"{page.stem}_snippets.py" for page in LONG}
    for page in LONG:
        written = (tmp_path / f"{page.stem}_snippets.py").read_text()
        assert written == snippets.HEAD + "".join(re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL))


def test_a_snippet_that_is_not_found_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"has 2 snippets, of which 1 begin and end a line"):
        steps("```python\na = 1\n```\n\n  ```python\n  b = 2\n  ```\n")


FLAGS = doctest.IGNORE_EXCEPTION_DETAIL
WITH_EXAMPLES = [
    ".".join([package, *path.relative_to(folder).with_suffix("").parts]).removesuffix(".__init__")
    for package, folder in PACKAGES.items()
    for path in sorted(folder.rglob("*.py"))
    if re.search(r"^ *>>> ", path.read_text(encoding="utf-8"), re.MULTILINE)
]


@pytest.mark.parametrize("name", WITH_EXAMPLES)
def test_examples_run(name: str) -> None:
    module = import_module(name)
    examples = doctest.DocTestFinder(recurse=False).find(module, module.__name__)
    assert sum(len(example.examples) for example in examples) > 0
    runner = doctest.DocTestRunner(optionflags=FLAGS)
    for example in examples:
        runner.run(example)
    assert runner.failures == 0


def test_modules_of_the_reference_have_examples() -> None:
    assert len(WITH_EXAMPLES) >= 11
    assert set(WITH_EXAMPLES) <= set(MODULES)


NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
MOST_BYTES_OF_A_NOTEBOOK = 200_000


def test_there_are_two() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["control_engineers", "reinforcement_learning"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_small_and_has_its_outputs_and_its_links_lead_somewhere(path: Path) -> None:
    nbformat = pytest.importorskip("nbformat", reason="the extra `test` brings it, with nbclient")
    assert path.stat().st_size < MOST_BYTES_OF_A_NOTEBOOK
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1)), "run all cells in their order"
    assert all(cell.outputs for cell in cells[1:])
    shown = [str(output) for cell in cells for output in cell.outputs]
    assert not re.search(r"Traceback|/home/|/work/|Warning", "".join(shown))
    text = "".join(cell.source for cell in notebook.cells if cell.cell_type == "markdown")
    links = re.findall(r"\]\(([^)#:]+)", text)
    assert links
    assert [link for link in links if not (path.parent / link).exists()] == []


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:IPykernel is not:UserWarning")
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs(path: Path, tmp_path: Path) -> None:
    for name in ("nbclient", "ipykernel"):
        pytest.importorskip(name, reason="the extra `test` brings it")
    cells = [cell for cell in executed(path, tmp_path).cells if cell.cell_type == "code"]
    assert all(cell.outputs for cell in cells[1:])  # the first one imports
