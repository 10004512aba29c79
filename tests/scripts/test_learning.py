"""`python -m scripts.learning`: schedules of gains, tables in their page, curves."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexarm_agents import TrainingConfig
from flexarm_agents.files import write_json
from scripts.common import markdown
from scripts.common.curves import keep_curves
from scripts.common.markdown import fill_pages, filled, shown_blocks
from scripts.common.spreads import millimetres, spread_text
from scripts.common.trainings import Training
from scripts.learning import foresight, records
from scripts.learning.__main__ import STUDIES, Options, check_complete, missing, study_tables
from scripts.learning.foresight import Schedule, kept_search, weights
from scripts.learning.modes import LawAlone
from scripts.learning.schedulers import PLANTS
from scripts.learning.study import Study, by_agent, jobs_of
from tests.support.programs import refusal
from tests.support.refusals import refuses
from tests.support.trainings import recorded, row


def test_every_table_stands_on_a_page() -> None:
    blocks = shown_blocks()
    for study in STUDIES.values():
        for name in study.names:
            assert len(blocks[name].splitlines()) > 3


def test_trainings_differ_in_seed_and_folder() -> None:
    study = STUDIES["schedulers"]
    jobs = jobs_of(study, 2, Path("here"))
    assert [config.seed for config, _ in jobs] == [0, 0, 1, 1]  # a first figure of each agent comes early
    assert jobs[3] == (replace(study.agents["paper"], seed=1), Path("here/paper/seed-1"))
    found = [Training(config, folder, {}) for config, folder in jobs]
    assert {name: [one.config.seed for one in own] for name, own in by_agent(found).items()} == {
        "square": [0, 1],
        "paper": [0, 1],
    }


def test_spreads() -> None:
    laps = {"swing": [[0.1], [None], [0.3]], "plain": [[0.1], [0.1], [0.1]]}
    three = recorded(TrainingConfig(), {}, {}, {}, **laps)
    assert spread_text(three.spread("swing", "rms")) == "0.300 / lost / lost"
    assert millimetres(three.spread("swing", "rms")) == "300 / lost / lost"
    assert (millimetres(0.01234, 1), millimetres(None)) == ("12.3", "lost")
    one = three._replace(trainings=three.trainings[:1])
    assert spread_text(one.spread("plain", "rms"), 1) == "0.1"


def test_a_schedule_is_linear_between_its_knots() -> None:
    np.testing.assert_allclose(weights(2, 4), [[0.75, 0.25, 0, 0], [0.25, 0.75, 0.75, 0.25], [0, 0, 0.25, 0.75]])
    schedule, state, gains = Schedule((0.0, 1.0, 0.5), 4), None, []
    for _ in range(4):
        action, state = schedule.predict(np.zeros(3), state)
        gains.append((action.item() + 1.0) / 2.0)
    np.testing.assert_allclose(gains, [0.25, 0.75, 0.875, 0.625])


def test_the_search_finds_what_is_best(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """On a plant whose error is the gain's distance from a line. The file keeps the schedule."""
    wanted = np.linspace(0.2, 0.8, 30)

    def errors(plant: Any, gains: np.ndarray, lap: str) -> np.ndarray:
        return np.stack([gains - wanted, 0.0 * gains], axis=-1)

    monkeypatch.setattr(foresight.Plant, "errors", errors)
    monkeypatch.setattr(foresight.Plant, "periods", 30)
    monkeypatch.setattr(foresight, "LEVELS", (2, 4))
    plant = PLANTS["square"]
    found = kept_search(plant, "swing", tmp_path / "search.json")
    assert found.constant == 0.5
    assert [len(one) for one in found.knots] == [3, 5]
    np.testing.assert_allclose(Schedule(found.knots[-1], 30).actions[:, 0], 2.0 * wanted - 1.0, atol=1e-3)
    assert kept_search(plant, "swing", tmp_path / "search.json") == found
    with refuses(ValueError, "search.json: has the schedule of another"):
        kept_search(plant, "plain", tmp_path / "search.json")


def test_a_schedule_scores_the_same_in_batch_and_alone() -> None:
    """The fit's errors are those of the standard score."""
    plant = PLANTS["square"]
    schedule = Schedule((0.5, 0.9, 0.6), plant.periods)
    gains = (schedule.actions[:, 0].astype(float) + 1.0) / 2.0
    several = foresight.rms(plant.errors(np.stack([gains, 0.0 * gains + 0.7]), "plain"))
    alone = plant.score(schedule, "plain").rms
    assert alone == pytest.approx(several[0], rel=1e-3)  # the score has the lap's first instant, too
    assert several[0] != pytest.approx(several[1], rel=1e-2)


def test_the_law_alone_adds_nothing() -> None:
    assert LawAlone().predict(np.ones((5, 7))).shape == (5, 2)
    assert not LawAlone().predict(np.ones(7)).any()


def test_curves_are_kept(tmp_path: Path) -> None:
    """Of all agents, those that were not trained now included; a lost lap has no error."""
    laps = [row(100 * n, rms, rms) for n, rms in enumerate((None, 0.2, 0.1), 1)]
    found = [Training(TrainingConfig(seed=seed), tmp_path / "mine" / f"seed-{seed}", laps[-1]) for seed in range(2)]
    for one in found:
        one.folder.mkdir(parents=True)
        write_json(one.folder / "evaluations.json", laps)
    keep_curves({"first": found}, tmp_path)
    keep_curves({"second": found[:1]}, tmp_path)
    data = json.loads((tmp_path / "curves.json").read_text())
    assert list(data) == ["first", "second"]
    assert data["first"][1] == {
        "seed": 1,
        "steps": [100, 200, 300],
        "seconds": [1.0, 1.0, 1.0],
        "swing": [None, 0.2, 0.1],
        "plain": [None, 0.2, 0.1],
    }
    assert (tmp_path / "curves.png").stat().st_size > 10_000


def test_a_clone_has_no_folder_for_tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Tables of data alone are written where nothing was trained."""
    monkeypatch.setitem(STUDIES, "mine", Study("mine", {}, 1, lambda agents, folder: {"mine": "new"}, ("mine",)))
    study_tables("mine", Options(train=False, output=tmp_path / "results" / "learning"))
    assert (tmp_path / "results" / "learning" / "mine.md").read_text() == "new"


def test_studies_fill_their_own_blocks(tmp_path: Path) -> None:
    page = "<!-- generated: mine -->\nold\n<!-- end -->\n<!-- generated: theirs -->\nold\n<!-- end -->\n"
    (tmp_path / "mine.md").write_text("new\n")
    assert filled(page, tmp_path, ["mine"]) == page.replace("old", "new", 1)
    with pytest.raises(FileNotFoundError):
        filled(page, tmp_path)


def test_blocks_are_filled_on_the_pages_that_have_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(markdown, "DOCS", tmp_path)
    (tmp_path / "mine.md").write_text("new\n")
    (tmp_path / "more").mkdir()
    page = tmp_path / "more" / "page.md"
    page.write_text("<!-- generated: mine -->\nold\n<!-- end -->\n")
    assert fill_pages(tmp_path, ["mine"]) == [page]
    assert shown_blocks() == {"mine": "new\n"}
    with pytest.raises(ValueError, match="generated block theirs"):
        fill_pages(tmp_path, ["mine", "theirs"])


def test_what_is_refused() -> None:
    assert "only = 'none': must be one of 'schedulers'" in refusal("learning", "--only", "none")
    assert "seeds = 0" in refusal("learning", "--seeds", 0)
    assert "tables = False: must go with train, and without docs" in refusal("learning", "--docs", "--no-tables")
    assert "tables = False" in refusal("learning", "--no-train", "--no-tables")
    assert "missing = True" in refusal("learning", "--no-train", "--missing")


def laid(study: Study, name: str, seed: int, rms: float, folder: Path) -> Training:
    """Lay a finished training's evaluations into a study's folder."""
    path = folder / name / f"seed-{seed}"
    path.mkdir(parents=True)
    best = row(100, rms, None)
    write_json(path / "evaluations.json", [best])
    return Training(replace(study.agents[name], seed=seed), path, best)


def test_records_are_kept(tmp_path: Path) -> None:
    """Of trainings that are gone, too, while their configuration is the same; those that are there replace theirs."""
    asked = []

    def measure(training: Training, folder: Path) -> dict[str, Any]:
        asked.append((training.folder, folder))
        return {"errors": [1.0 / 7.0, None]}

    study = STUDIES["delays"]._replace(measure=measure, timed=False)
    data = tmp_path / "kept.json"
    assert records.read(study, data) == {}
    first = [laid(study, "known-stacked", seed, 0.1, tmp_path / "first") for seed in range(2)]
    agents = records.renewed(study, first, tmp_path, {})
    assert asked == [(one.folder, tmp_path) for one in first]
    records.write(agents, data)
    assert records.read(study, data) == agents
    assert data.read_text().count("\n   {") == 2  # a line for each training
    again = [laid(study, "known-stacked", 1, 0.2, tmp_path / "again"), laid(study, "known-none", 3, 0.3, tmp_path)]
    agents = records.renewed(study, again, tmp_path, records.read(study, data))
    assert list(agents) == ["known-none", "known-stacked"]
    stacked = agents["known-stacked"].trainings
    assert [(one.seed, one.best["swing"]["rms"]) for one in stacked] == [(0, 0.1), (1, 0.2)]
    assert stacked[0].measured == {"errors": [0.142857, None]}
    assert stacked[0].best["plain"]["rms"] is None
    assert stacked[1].curve == {"steps": [100], "seconds": [1.0], "swing": [0.2], "plain": [None]}
    assert [one.curve["swing"] for one in agents["known-stacked"].trainings] == [[0.1], [0.2]]
    records.write(agents, data)
    lost = replace(study.agents["known-stacked"], gamma=0.9)  # type: ignore[type-var]
    other = study._replace(agents={**study.agents, "known-stacked": lost})
    assert list(records.read(other, data)) == ["known-none"]


def test_only_what_is_missing_is_trained(tmp_path: Path) -> None:
    study = STUDIES["delays"]
    jobs = jobs_of(study, 2, tmp_path)
    known = {"known-none": recorded(study.agents["known-none"], {}), "known-actions": recorded(jobs[0][0], {}, {})}
    lacking = {(folder.parent.name, config.seed) for config, folder in missing(jobs, known)}
    whole = {(name, seed) for name in study.agents for seed in range(2)}
    assert whole - lacking == {("known-none", 0), ("known-actions", 0), ("known-actions", 1)}


def test_tables_of_what_is_known() -> None:
    """A study says whether it can do without some of its agents."""
    study = STUDIES["delays"]
    known = {"known-none": recorded(study.agents["known-none"], {})}
    check_complete(study, known)
    with refuses(ValueError, "no training of known-none, ", "is finished; train first"):
        check_complete(study, {})
    with refuses(ValueError, "train = False: no training of known-actions, "):
        check_complete(study._replace(partial=False), known)
