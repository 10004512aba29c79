"""The notebooks run as they are committed, and are committed with their outputs."""

import re
from pathlib import Path
from typing import Any

import pytest

from scripts.docs.notebooks import FOLDER, executed

NOTEBOOKS = sorted(FOLDER.glob("*.ipynb"))
MOST_BYTES = 200_000


def notebook(path: Path) -> Any:
    nbformat = pytest.importorskip("nbformat", reason="the extra `test` brings it, with nbclient")
    read = nbformat.read(path, as_version=4)
    nbformat.validate(read)
    return read


def test_there_are_two() -> None:
    assert [path.stem for path in NOTEBOOKS] == ["control_engineers", "reinforcement_learning"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_small_and_has_its_outputs(path: Path) -> None:
    assert path.stat().st_size < MOST_BYTES
    cells = [cell for cell in notebook(path).cells if cell.cell_type == "code"]
    assert [cell.execution_count for cell in cells] == list(range(1, len(cells) + 1)), "run all cells in their order"
    assert all(cell.outputs for cell in cells[1:])
    shown = [str(output) for cell in cells for output in cell.outputs]
    assert not re.search(r"Traceback|/home/|/work/|Warning", "".join(shown))


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_the_links_of_a_notebook_lead_somewhere(path: Path) -> None:
    text = "".join(cell.source for cell in notebook(path).cells if cell.cell_type == "markdown")
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
