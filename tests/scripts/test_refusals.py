"""What the studies refuse: at once, with nothing written, and old results left alone."""

from pathlib import Path

import pytest

from tests.support.programs import refusal

CASES = [
    ("benchmarks", "--repeats 0", "error: repeats = 0: must be"),
    ("benchmarks", "--cold -1", "error: cold = -1: must be"),
    ("benchmarks", "--only laps", "error: only = 'laps': must be one of 'Jacobians'"),
    ("control", "--only none", "only = 'none': must be one of 'registered'"),
    ("control", "--jobs 0", "jobs = 0"),
    ("learning", "--only none", "only = 'none': must be one of 'delays'"),
    ("optimise", "--arms none", "arms = 'none': must be one of"),
    ("optimise", "--laps round", "laps = 'round': must be one of"),
    ("optimise", "--paths spiral", "paths = 'spiral': must be one of"),
    ("paper", "--K-s -1", "K_s = -1"),
    ("paper", "--lap-time 0", "lap_time = 0"),
    ("paper", "--lap-time 1.2345", "lap_time = 1.2345"),
    ("paper", "--workers 0", "workers = 0"),
    ("paper", "--parameters no_such_file.json", "no_such_file.json"),
    ("paper", "--output thesis", "output = thesis: exists and holds no summary.json"),
    ("shipped", "--seeds 4", "seeds = 4: must be odd"),
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
