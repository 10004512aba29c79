"""`python -m scripts.analysis` end to end, and docs/analysis.md against what it produces."""

import json
import re
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from tests.support.programs import ROOT, help_of, refusal, results_of, run_study

PAGE = ROOT / "docs" / "analysis.md"
BLOCK = re.compile(r"<!-- generated: (\w+) -->\n(.*?)<!-- end -->", re.DOTALL)
TABLES = {"zeros_by_model", "passivity", "margins", "simulated", "largest_gains"}
TABLES |= {"margins_claim", "margins_by_modes"}
PICTURES = {"zeros_locus", "passivity", "margins"}
run_script = partial(run_study, "analysis")


@pytest.fixture(scope="module")
def quick(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return results_of("analysis", tmp_path_factory.mktemp("analysis") / "quick", "--quick")


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return results_of("analysis", tmp_path_factory.mktemp("analysis") / "full")


def committed() -> dict[str, str]:
    return dict(BLOCK.findall(PAGE.read_text()))


def prose() -> str:
    return " ".join(PAGE.read_text().split())


def read(results: Path) -> dict[str, Any]:
    return json.loads((results / "analysis.json").read_text())


def test_results_are_complete(quick: Path) -> None:
    assert {path.stem for path in quick.glob("*.md")} == TABLES
    for suffix in ("png", "svg"):
        assert {path.stem for path in (quick / "figures").glob(f"*.{suffix}")} == PICTURES
    assert set(read(quick)) >= {"zeros", "passivity", "margins", "profile", "simulated", "largest_gains"}
    assert [path.name for path in quick.parent.iterdir()] == [quick.name], "work files were left behind"


def test_committed_tables_have_the_rows_of_a_quick_run(quick: Path) -> None:
    """Those that a quick run makes as a full one does. All of them take a full run, below."""
    pages = committed()
    assert set(pages) == TABLES
    for name in ("zeros_by_model", "largest_gains", "margins_by_modes"):
        rows = (quick / f"{name}.md").read_text().splitlines()
        assert len(rows) > 3
        for row in rows:
            assert row in pages[name], f"{name} is out of date: run `make docs`; {row}"


def test_committed_margins_are_those_of_a_quick_run(quick: Path) -> None:
    """That has the paper's arm under IFDC, the last figure of each cell."""
    rows = [row.split(" | ") for row in (quick / "margins.md").read_text().splitlines()[2:]]
    pages = [row.split(" | ") for row in committed()["margins"].splitlines()[2:]]
    assert len(rows) == 6
    for row, page in zip(rows, pages[:6], strict=True):
        assert row[:4] == page[:4]
        assert row[4:6] == [cell.split(" / ")[-1] for cell in page[4:6]], "out of date: run `make docs`"


@pytest.mark.slow
def test_all_committed_tables_match(full: Path) -> None:
    for name, text in committed().items():
        assert text == (full / f"{name}.md").read_text(), f"{name} is out of date: run `make docs`"


@pytest.mark.slow
def test_figures_of_the_simulation_in_the_text_match(full: Path) -> None:
    worst = 0.0
    results = read(full)
    linear = {(r["sensor"], r["delayed"], r["controller"]): r for r in results["margins"] if r["arm"] == "paper's arm"}
    for row in results["simulated"]:
        for place in ("corner", "mid-side"):
            own = linear[row["sensor"], row["delayed"], row["controller"]][place]["delay_margin"]
            worst = max(worst, *(abs(end / own - 1.0) for end in row[place]))
    assert f"within {100.0 * worst:.1f} %" in prose()


@pytest.mark.slow
def test_figures_in_the_text_match(full: Path) -> None:
    """Every sentence of docs/analysis.md that quotes a figure, with the figure put in by the results."""
    results, text = read(full), prose()
    models = {row["arm"]: row for row in results["zeros"]["by_model"]}
    one = models["1 mode, undamped"]
    paper = [row for row in results["margins"] if row["arm"] == "paper's arm"]
    margins = {(r["sensor"], r["delayed"], r["controller"]): r for r in paper}
    late = margins["end effector", "position", "IFDC"]
    rates = margins["end effector", "position+rate", "IFDC"]
    gains = {row["what"]: row for row in results["largest_gains"]}
    law = results["passivity"]["law"]
    tip = gains["true tip, not late, 1 mode, 1 %"]
    sentences = [
        f"tanh z = 0: {models['exact beam']['zero']:.2f} rad/s",
        f"1/z of the exact beam is {1e3 / models['exact beam']['zero']:.0f} ms",
        f"{100.0 * 3.15 / models['exact beam']['zero']:.0f} cm",
        f"at {one['entries'][0]:.2f} m, {100 * one['entries'][0] / 4.5:.0f} % of the link",
        f"Kd / Kp = {1e3 * law['longest_passive_delay']:.0f} ms",
        f"from {law['active_from']:.0f} rad/s on",
        f"{1e3 * late['corner']['delay_margin']:.0f} to {1e3 * late['mid-side']['delay_margin']:.0f} ms for IFDC",
        f"{1e3 * rates['corner']['delay_margin']:.2f} to {1e3 * rates['mid-side']['delay_margin']:.2f} ms",
        f"lambda = {tip['corner']:.3f} on a corner and {tip['mid-side']:.3f} in the middle of a side",
    ]
    for sentence in sentences:
        assert sentence in text, f"not in docs/analysis.md: {sentence}"


def test_the_claim_about_margins_follows_from_the_table_of_margins() -> None:
    """Of all rows of the committed table, not only of the paper's arm and two sensors."""
    rows = [line.strip("| ").split(" | ") for line in committed()["margins"].splitlines()[2:]]
    ratios = {late: [float(margin) / float(cells[3]) for cells in rows if cells[2] == late for at in (4, 5)
                     for margin in cells[at].split(" / ")] for late in ("position", "position and rate")}  # fmt: skip
    late, room = [1.0 / ratio for ratio in ratios["position and rate"]], ratios["position"]
    assert len(late) == len(room) == 36
    claim = " ".join(committed()["margins_claim"].split())
    found = re.search(r"with (\S+) times the paper's delay in the worst case, (\S+) times in the best", claim)
    assert found
    assert [float(x) for x in found.groups()] == pytest.approx([min(room), max(room)], abs=0.06)
    found = re.search(r"and (\S+) to (\S+) times over both arms and all three sensors", claim)
    assert found
    assert [float(x) for x in found.groups()] == pytest.approx([min(late), max(late)], rel=0.02)


def test_the_locus_has_a_panel_for_every_arm_and_the_exact_zeros_of_link_1(quick: Path) -> None:
    found = read(quick)
    locus = found["zeros"]["locus"]
    assert "2 modes, 1 % (linear arm)" in locus
    exact = next(row["zero"] for row in found["zeros"]["by_model"] if row["arm"] == "exact beam")
    assert locus["exact link 1"][0] == pytest.approx(exact)


def test_fuzzy_gains_are_those_that_the_margins_are_made_for(quick: Path) -> None:
    low, high = read(quick)["fuzzy_gains"]
    assert low == pytest.approx(1.0 / 6.0)
    assert high == pytest.approx(5.0 / 6.0)


def test_bad_options_are_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    assert f"output = {tmp_path}" in refusal("analysis", "--quick", "--output", tmp_path)
    assert (tmp_path / "thesis.tex").exists()
    refusal("analysis", "--quick", "--docs", "--output", tmp_path / "new")
    told = help_of("analysis")
    for option in ("--output", "--quick", "--docs"):
        assert option in told
