"""What the studies share: the command, generated blocks of pages, and how errors are written."""

import sys
from functools import partial
from pathlib import Path

import pytest
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from flexarm_agents import Spread
from scripts.common import markdown, study
from scripts.common.markdown import fill_pages, millimetres, shown_blocks, spread_text
from scripts.common.study import Study, Trials, command
from tests.support.programs import refusal


def test_errors_of_several_trainings() -> None:
    assert millimetres(Spread.of([0.1, None, 0.3])) == "300 / lost / lost"
    assert (millimetres(0.01234, 1), millimetres(None)) == ("12.3", "lost")
    assert spread_text(Spread.of([0.1]), 1) == "0.1"


def test_blocks_are_filled_on_the_pages_that_have_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(markdown, "DOCS", tmp_path)
    page, other = tmp_path / "more" / "page.md", tmp_path / "other.md"
    page.parent.mkdir()
    other.write_text("text")
    page.write_text("a\n<!-- generated: mine -->\nold\n<!-- end -->\n<!-- generated: theirs -->\nold\n<!-- end -->\n")
    assert fill_pages({"mine": "new\n"}) == [page]
    assert shown_blocks() == {"mine": "new\n", "theirs": "old\n"}
    with pytest.raises(ValueError, match="generated block none"):
        fill_pages({"mine": "newer\n", "none": ""})
    assert shown_blocks()["mine"] == "new\n"


def parabola(results: dict[str, float]) -> Figure:
    figure, axis = plt.subplots()
    axis.plot(list(results.values()))
    return figure


@pytest.mark.parametrize("svg", [False, True])
def test_a_study_shows_its_results_in_docs(svg: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    docs, output = tmp_path / "docs", tmp_path / "results"
    docs.mkdir()
    (docs / "page.md").write_text("<!-- generated: squares -->\nold\n<!-- end -->\n")
    monkeypatch.setattr(markdown, "DOCS", docs)
    monkeypatch.setattr(study, "DOCS", docs)
    monkeypatch.setattr(sys, "argv", ["", "--output", str(output), "--only", "squares", "--docs"])
    trials = Trials("scripts.common.study", lambda: {str(n): partial(pow, n, 2) for n in (2, 3)})
    squares = Study("squares", trials, {"squares": lambda found: f"{found}\n"}, {"sub/squares": parabola}, svg)
    command("mine", {"squares": squares, "others": squares}, "Square numbers.")
    assert shown_blocks() == {"squares": "{'2': 4, '3': 9}\n"}
    picture = output / "figures" / "sub" / "squares.png"
    assert (docs / "figures" / "sub" / "squares.png").read_bytes() == picture.read_bytes()
    assert picture.with_suffix(".svg").is_file() == svg


CASES = [
    ("benchmarks", "--repeats 0", "error: repeats = 0: must be"),
    ("benchmarks", "--cold -1", "error: cold = -1: must be"),
    ("benchmarks", "--only laps", "error: only = 'laps': must be one of 'Jacobians'"),
    ("control", "--only none", "only = 'none': must be one of 'registered'"),
    ("control", "--jobs 0", "jobs = 0"),
    ("docs.pictures", "--only payload.png none --output new", "only = 'none': must be one of 'first_second.webp'"),
    ("leaderboard", "--no-measure --entries lqg", "no_measure = True: the page shows the whole board; must go without"),
    ("learning", "--only none", "only = 'none': must be one of 'delays'"),
    ("optimise", "--arms none", "arms = 'none': must be one of"),
    ("optimise", "--laps round", "laps = 'round': must be one of"),
    ("optimise", "--paths spiral", "paths = 'spiral': must be one of"),
    ("optimise", "--arms linear --paths circle", "paths = circle: none is planned on arms = linear"),
    ("optimise", "--finalists 0", "finalists = 0: must be an integer >= 1"),
    ("optimise.race", "--passes 0", "passes = 0: must be an integer >= 1"),
    ("optimise.race", "--rounds 0", "rounds = 0: must be an integer >= 1"),
    ("paper", "--K-s -1", "K_s = -1"),
    ("paper", "--lap-time 0", "lap_time = 0"),
    ("paper", "--lap-time 1.2345", "lap_time = 1.2345"),
    ("paper", "--workers 0", "workers = 0"),
    ("paper", "--parameters no_such_file.json", "no_such_file.json"),
    ("paper", "--output thesis", "output = thesis: exists and holds no summary.json"),
    ("train", "--seeds 0-1 --seed 3", "seed = 3: must go without --seeds"),
]


@pytest.mark.parametrize(("study", "line", "message"), CASES)
def test_bad_options_are_refused_before_any_work(
    study: str, line: str, message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for there in ("results/paper/summary.json", "thesis/thesis.tex"):
        (tmp_path / there).parent.mkdir(parents=True)
        (tmp_path / there).touch()
    before = set(tmp_path.rglob("*"))
    assert message in refusal(study, *line.split())
    assert set(tmp_path.rglob("*")) == before
